// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

// Renders views of a virtual camera from the images of a camera array. This header includes:
//
//   error.h     Error, the exception that all functions throw
//   image.h     Image and ImageView, which hold pixels
//   rig.h       Rig, the description of the camera array and its file; View, the virtual camera; Focus
//   renderer.h  Renderer, which makes pictures from images in this process
//   version.h   version(), and the rules of binary compatibility
//   node.h      Node, which serves the cameras of one machine; Compositor, which shows the cameras of remote nodes
//
// calibration.h, which calibrates arrays, belongs to a separate library and must be included separately. lf.h also
// defines a short name for the namespace. Start with docs/guides/embedding.md; docs/architecture.md explains the
// coordinate systems and how pictures are made.
#include <lightfield/error.h>
#include <lightfield/image.h>
#include <lightfield/node.h>
#include <lightfield/renderer.h>
#include <lightfield/rig.h>
#include <lightfield/version.h>
