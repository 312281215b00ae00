// SPDX-License-Identifier: LGPL-2.1-or-later
// Replaces the rest of this folder in builds with the option gl=disabled. There is never a GPU, so the CPU computes all
// sums.
#include "base/text.h"
#include "render/gl/gles_renderer.h"
#include "render/gl/gpu_sum.h"

namespace lf::gl {
namespace {

constexpr char kWhy[] = "this build has no OpenGL";

}  // namespace

struct Context::Handles {};
Context::~Context() = default;

struct GlesRenderer::Objects {};
std::unique_ptr<GlesRenderer> GlesRenderer::create(Context::Drivers, std::string& why) {
  why = kWhy;
  return nullptr;
}
std::unique_ptr<GlesRenderer> GlesRenderer::create_in(Context::External, Context::Drivers, std::string& why) {
  why = kWhy;
  return nullptr;
}

// The remaining functions are never called: objects of these classes are never made.
GlesRenderer::~GlesRenderer() = default;
void GlesRenderer::draw(std::span<GlesJob>, const ParallelFor&) { throw Error(kWhy); }
bool GlesRenderer::draw_consistency(const ConsistencyTask&, std::span<const Source>,
                                    const std::function<Rect(const Source&)>&, const ParallelFor&, ConsistencyReadback&,
                                    std::string&) {
  throw Error(kWhy);
}
bool ReadbackBuffer::copy_rows(int, int, const SumPlanes&) const { throw Error(kWhy); }

GpuSum::~GpuSum() = default;
PixelFamily GpuSum::family() const { throw Error(kWhy); }
const Rect& GpuSum::rect() const { throw Error(kWhy); }
ShareGroup GpuSum::group() const { throw Error(kWhy); }
ConstSumPlanes GpuSum::fetch() { throw Error(kWhy); }
std::shared_ptr<GpuSum> GpuSum::add(std::span<const std::shared_ptr<GpuSum>>, std::string&) { throw Error(kWhy); }
bool GpuSum::draw(const GpuPicture&, std::string&) { throw Error(kWhy); }
bool GpuSum::wait(std::string&) { throw Error(kWhy); }

}  // namespace lf::gl
