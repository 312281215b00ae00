// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

// Renders views of a virtual camera from the images of a camera array.
//
//   error.h     Error, the exception of all functions
//   image.h     Image, ImageView: pixels
//   rig.h       Rig, Camera, Lens, Pose: the array and its file; View: the virtual camera; Focus
//   renderer.h  Renderer: pictures from images in this process
//   node.h      Node: the cameras of one machine; Compositor: a viewer of remote nodes; Bytes: encoded messages
//
// calibration.h calibrates arrays. It belongs to a separate library and must be included separately. Introduction:
// docs/guides/embedding.md. Conventions and rendering rule: docs/architecture.md.
#include <lightfield/error.h>
#include <lightfield/image.h>
#include <lightfield/node.h>
#include <lightfield/renderer.h>
#include <lightfield/rig.h>

namespace lf = lightfield;
