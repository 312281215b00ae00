// SPDX-License-Identifier: LGPL-2.1-or-later
// The layout of the public structs, which programs are compiled with. A change needs a new soname. (New options use the
// member `reserved`.) debian/*.symbols records the functions.
#include <cstddef>

#include <lightfield/calibration.h>
#include <lightfield/lightfield.h>

namespace lightfield {

#ifdef __x86_64__
#pragma GCC diagnostic ignored "-Winvalid-offsetof"  // std::optional is allowed by GCC and Clang
static_assert(sizeof(Vec3) == 24);
static_assert(sizeof(Quaternion) == 32);
static_assert(sizeof(Pose) == 56);
static_assert(sizeof(Lens) == 120);
static_assert(sizeof(CameraColour) == 120);
static_assert(sizeof(Camera) == 416);
static_assert(sizeof(Topology) == 40);
static_assert(sizeof(Rig) == 16);
static_assert(sizeof(View) == 248);
static_assert(sizeof(Colour) == 3);
static_assert(sizeof(Image) == 40);
static_assert(sizeof(ImageView) == 64);
static_assert(sizeof(MutableImageView) == 64);
static_assert(sizeof(RenderOptions) == 64);
static_assert(sizeof(Renderer) == 8);
static_assert(sizeof(RequestInfo) == 16);
static_assert(sizeof(NodeOptions) == 40);
static_assert(sizeof(Node) == 8);
static_assert(sizeof(RequestOptions) == 104);
static_assert(sizeof(Compositor) == 8);
static_assert(sizeof(Compositor::AddResult) == 40);
static_assert(sizeof(Tracks) == 64);
static_assert(sizeof(Tracks::Camera) == 12);
static_assert(sizeof(Tracks::Observation) == 40);
static_assert(sizeof(CalibrationOptions) == 136);
static_assert(sizeof(Covariance) == 56);
static_assert(sizeof(Finding) == 72);
static_assert(sizeof(Calibration) == 112);
static_assert(offsetof(View, reserved) == 216);
static_assert(offsetof(RenderOptions, reserved) == 32);
static_assert(offsetof(NodeOptions, reserved) == 8);
static_assert(offsetof(RequestOptions, reserved) == 72);
static_assert(offsetof(CalibrationOptions, reserved) == 104);
static_assert(offsetof(Lens, fisheye) == 112);
static_assert(offsetof(Camera, colour) == 288);
static_assert(offsetof(Image, pixels) == 16);
static_assert(offsetof(ImageView, stride) == 40);
static_assert(offsetof(MutableImageView, stride) == 40);
static_assert(offsetof(Calibration, scale_from) == 80);
#endif

}  // namespace lightfield
