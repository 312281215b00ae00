// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

// Light fields in other programs: pictures of a virtual camera from the images of an array of cameras.
//
//   error.h     Error: what is thrown
//   image.h     Image, ImageView: pixels
//   rig.h       Rig, Camera, Lens, Pose: the array, and its file; View: the virtual camera; Focus
//   renderer.h  Renderer: pictures from images in this process
//   node.h      Node: the cameras of one machine; Compositor: a viewer of nodes elsewhere; Bytes: what travels
//
// calibration.h, which measures arrays, is a library of its own and is included by itself. docs/guide-embedding.md has
// an introduction, docs/design.md the conventions and the rendering rule.
#include <lightfield/error.h>
#include <lightfield/image.h>
#include <lightfield/node.h>
#include <lightfield/renderer.h>
#include <lightfield/rig.h>

namespace lf = lightfield;
