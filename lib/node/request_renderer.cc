// SPDX-License-Identifier: LGPL-2.1-or-later
#include "node/request_renderer.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <optional>
#include <utility>

#include "base/schedule.h"
#include "focus/hypothesis_renderer.h"
#include "image/image_filters.h"
#include "render/gl/gles_renderer.h"
#include "wire/consistency_codec.h"

namespace lf {
namespace {

void make_room(std::vector<ByteBuffer>& images, size_t count) { images.resize(std::max(images.size(), count)); }

}  // namespace

size_t ImageMemory::size() const {
  size_t bytes = 0;
  for (const auto* kind : {&corrected, &matched, &sharpened})
    for (const ByteBuffer& image : *kind) bytes += image.size();
  return bytes;
}

size_t ImageMemory::capacity() const {
  size_t bytes = 0;
  for (const auto* kind : {&corrected, &matched, &sharpened})
    for (const ByteBuffer& image : *kind) bytes += image.capacity();
  return bytes;
}

void ImageMemory::clear() {
  for (auto* kind : {&corrected, &matched, &sharpened})
    for (ByteBuffer& image : *kind) image.clear();
}

const ExposureCompensation& GainMatcher::gains_for(const GainRequest& request) {
  if (request.mean.empty() || seen_.empty() || request.mean_of != sequence_) return gains_;
  gains_.take(WideLuma::ratios(seen_, request.mean));
  seen_.clear();
  return gains_;
}

void GainMatcher::keep(uint32_t sequence, std::vector<WideLuma::Camera> seen) {
  sequence_ = sequence;
  seen_ = std::move(seen);
}

std::vector<Source> GainMatcher::match(std::span<const Source> sources, const ExposureCompensation& gains,
                                       const std::function<Rect(CameraIndex)>& region, std::vector<ByteBuffer>& memory,
                                       const ParallelFor& parallel) {
  std::vector<Source> matched(sources.begin(), sources.end());
  make_room(memory, sources.size());
  parallel(sources.size(), [&](size_t i) {
    const float gain = gains.of(sources[i].camera);
    if (std::abs(gain - 1) < kGainTolerance || sources[i].image.family == PixelFamily::kNone) return;
    if (sources[i].image.on_gpu.image) {
      matched[i].image.on_gpu.gain = gain;
      return;
    }
    const Rect rect = region(sources[i].camera);
    if (!rect.empty()) matched[i].image = divide_by_gain(sources[i].image, rect, gain, memory[i]);
  });
  return matched;
}

namespace {

using Works = std::span<const RequestRenderer::Work>;

Rect united(Works works, CameraIndex camera, Rect (RequestPlan::*part)(CameraIndex) const) {
  Rect all;
  for (const RequestRenderer::Work& work : works)
    if (work.plan->has(camera)) all = unite(all, (work.plan->*part)(camera));
  return all;
}

void correct(Works works, const RenderOptions& options, std::vector<ByteBuffer>& memory, std::vector<Source>& images) {
  if (!options.colours || !options.colours->any()) return;
  make_room(memory, images.size());
  // A brightness measurement covers more than the drawn region.
  const auto part = works.front().plan->wide() ? &RequestPlan::region : &RequestPlan::drawn_region;
  options.parallel(images.size(), [&](size_t i) {
    Source& source = images[i];
    if (source.image.family == PixelFamily::kNone) return;
    const ColourCorrection* const correction = options.colours->of(source.camera, source.image.family);
    if (!correction) return;
    const Rect rect = united(works, source.camera, part);
    if (rect.empty()) return;
    FetchBuffers nothing_made;
    const ImageView image = fetched(source.image, rect, nothing_made);
    source.image = image.family == PixelFamily::kNone ? image : correction->apply(image, rect, memory[i]);
  });
}

std::vector<Source> images_of(const RequestRenderer::Work& work, const std::vector<Source>& images) {
  std::vector<Source> own;
  if (work.has_images)
    std::ranges::copy_if(images, std::back_inserter(own),
                         [&work](const Source& source) { return work.plan->has(source.camera); });
  return own;
}

wire::ConsistencyHeader consistency_header(const wire::AnswerHeader& header, const std::optional<GainSum>& gains) {
  return {header.view_id, header.sequence, header.rig_hash, header.node, gains};
}

// Returns the sums of the hypothesis kMeasured at the nodes of a view's map, from a measured surface that is already
// warped to the view. The node weighs less the farther its cameras are away. The sums are 0 without a surface.
PhotoConsistency measured_sums(const View& view, const FocalMap* measured, float weight) {
  const FocalMap& map = *view.focus.map;
  PhotoConsistency sums;
  sums.reset(map.columns, map.rows);
  if (!measured || measured->levels.size() != sums.weight.size()) return sums;
  const auto known = static_cast<uint16_t>(std::lround(weight * PhotoConsistency::kWeightOne));
  for (size_t i = 0; i < sums.weight.size(); i++) {
    const uint8_t level = map.level_of(measured->inverse_of(measured->levels[i]));
    sums.weight[i] = measured->levels[i] > 0 ? known : 0;
    sums.luma[i] = PhotoConsistency::luma_of(sums.weight[i], level);
    sums.square[i] = PhotoConsistency::square_of(sums.luma[i], level);
  }
  return sums;
}

using Visibility = std::vector<std::optional<VisibilityMask>>;

bool is_measured(const RequestRenderer::Work& work, const View& view) {
  return work.depths && view.focus.map && view.focus.map->measured;
}

// Finds out which part of the surface of a job's view each camera sees, if the cameras have measured the surface.
// Covers `parts` of each camera's part of the view. `edges` are the edges of the surface, or null. `visibility` holds
// the masks.
void add_visibility(const RequestRenderer::Work& work, const RenderJob& job,
                    const std::function<std::vector<Rect>(CameraIndex)>& parts, const DepthEdges* edges,
                    const ParallelFor& parallel, std::vector<Source>& sources, Visibility& visibility) {
  const View& view = job.plan().view();
  if (!is_measured(work, view)) return;
  visibility.resize(sources.size());
  parallel(sources.size(), [&](size_t i) {
    visibility[i] = work.depths->visibility(view, sources[i].camera, parts(sources[i].camera), edges);
    if (visibility[i]) sources[i].visibility = &*visibility[i];
    sources[i].edges = edges;
  });
}

RenderedConsistency render_consistency(const RequestRenderer::Work& work, const std::vector<Source>& images,
                                       const RenderOptions& options) {
  const RenderJob* const job = work.plan->hypothesis_job();
  if (!job) return {};
  const uint64_t begun = now_ns();
  const std::vector<std::vector<uint8_t>>& hypotheses = work.plan->hypotheses();
  const View& view = job->plan().view();
  std::vector<PhotoConsistency> sums(hypotheses.size());
  for (PhotoConsistency& sum : sums) sum.reset(view.width, view.height);
  RenderedConsistency rendered{.nodes = hypotheses.size() * view.width * view.height};
  if (!hypotheses.empty()) {
    std::vector<Source> sources = images_of(work, images);
    Visibility visibility;
    const auto part = [job](CameraIndex camera) { return std::vector{job->plan().camera_rect(camera)}; };
    add_visibility(work, *job, part, nullptr, options.parallel, sources, visibility);
    rendered.drawing = add_consistency(*job, sources, hypotheses, sums, options.parallel, options.depth_gpu.get());
  }
  if (const View* const measured = work.plan->measured_view())
    sums.push_back(measured_sums(*measured, work.measured.get(), work.measured_weight));
  rendered.ns = now_ns() - begun;
  rendered.unit = wire::encode_consistency(consistency_header(work.header, {}), sums, !options.in_process);
  return rendered;
}

std::vector<Source> resampled(Works works, const RenderOptions& options, std::vector<ByteBuffer>& memory,
                              const std::vector<Source>& images) {
  std::vector<Source> sampled = images;
  if (options.resampling != Resampling::kSharpened) return sampled;
  make_room(memory, images.size());
  options.parallel(images.size(), [&](size_t i) {
    Source& source = sampled[i];
    if (source.image.family == PixelFamily::kNone) return;
    Rect shown;
    for (const RequestRenderer::Work& work : works)
      if (work.plan->has(source.camera) && work.plan->shows_detail(source.camera))
        shown = unite(shown, work.plan->answer_region(source.camera));
    if (shown.empty()) return;
    if (source.image.on_gpu.image)
      source.image.on_gpu.sharpened = true;
    else
      source.image = sharpen(source.image, shown, memory[i]);
  });
  return sampled;
}

struct Drawn {
  std::vector<Source> sources;
  std::optional<DepthEdges> edges;  // edges of the surface in the view
  Visibility visibility;            // of sources
  std::optional<SumRenderer> sum;  // empty if the answer has unwarped pixels, or no camera has an image yet
  uint64_t ns = 0;                 // nanoseconds
};

// `sampled` are the images for plans that show detail.
void draw(Works works, const std::vector<Source>& images, const std::vector<Source>& sampled,
          const RenderOptions& options, std::vector<Drawn>& drawn) {
  options.parallel(works.size(), [&](size_t i) {
    const RequestPlan* const plan = works[i].plan;
    const wire::AnswerHeader& header = works[i].header;
    auto& [sources, edges, visibility, sum, ns] = drawn[i];
    for (size_t k = 0; works[i].has_images && k < images.size(); k++)
      if (const CameraIndex camera = images[k].camera; plan->draws(camera))
        sources.push_back(plan->shows_detail(camera) ? sampled[k] : images[k]);
    if (!plan->sum() || header.family == PixelFamily::kNone) return;
    const uint64_t begun = now_ns();
    const RenderJob& job = *plan->sum();
    const auto tiles = [&job](CameraIndex camera) {
      return sum_tiles(job.plan(), job.runs(), {&camera, 1}, PixelFamily::kRgb, 0);
    };
    const FocalMap* const map = job.plan().view().focus.map.get();
    if (map && map->step == FocalMap::kMinStep && is_measured(works[i], job.plan().view())) {
      edges = works[i].depths->edges(job.plan().view(), options.parallel);
      add_visibility(works[i], job, tiles, &*edges, options.parallel, sources, visibility);
    }
    const bool is_in_group =
        options.in_process && options.gpu && options.group != 0 && options.gpu->group() == options.group;
    const Coding coding = choose_coding(options.codec, options.in_process, plan->quality());
    sum.emplace(plan->sum()->plan(), plan->sum()->runs(), sources, header.family, Coordinates::kGrid, nullptr,
                serial_for, is_in_group && coding.codec == wire::Codec::kRaw16);
    ns = now_ns() - begun;
  });
  std::vector<SumRenderer*> sums;
  for (Drawn& one : drawn)
    if (one.sum) sums.push_back(&*one.sum);
  if (!options.gpu || sums.empty()) return;
  const uint64_t begun = now_ns();
  SumRenderer::draw(sums, *options.gpu, options.parallel);
  const uint64_t each = (now_ns() - begun) / sums.size();
  for (Drawn& one : drawn)
    if (one.sum) one.ns += each;
}

void encode(const RequestRenderer::Work& work, Drawn& drawn, const RenderOptions& options, ByteBuffer memory,
            RenderedAnswer& answer) {
  const RequestPlan* const plan = work.plan;
  const wire::AnswerHeader& header = work.header;
  if (plan->sum() && !drawn.sum) {
    answer.bytes = wire::AnswerWriter(header, 0, std::move(memory)).finish();
    return;
  }
  const uint64_t begun = now_ns();
  if (drawn.sum) {
    SumRenderer& sum = *drawn.sum;
    sum.fetch(options.parallel);
    encode_sum(header, *plan, drawn.sources, sum, options, std::move(memory), answer);
    answer.drawing = sum.drawing();
    const Rect& rect = sum.rect();
    answer.pixels = plan->sum()->plan().blend() ? sum.samples() / 3 : static_cast<size_t>(rect.width()) * rect.height();
  } else {
    encode_pixels(header, *plan, drawn.sources, options, std::move(memory), answer);
  }
  answer.render_ns = drawn.ns + (now_ns() - begun) - answer.encode_ns;
}

}  // namespace

std::vector<RenderedAnswer> RequestRenderer::render(Works works, std::span<const Source> images,
                                                    const RenderOptions& options, ImageMemory& scratch,
                                                    const std::function<ByteBuffer()>& memory) {
  const uint64_t begun = now_ns();
  std::vector<RenderedAnswer> answers(works.size());
  std::vector<Source> ready(images.begin(), images.end());
  correct(works, options, scratch.corrected, ready);
  if (works.front().plan->gains()) match_gains(works, options, scratch.matched, ready, answers);
  for (size_t i = 0; i < works.size(); i++) answers[i].consistency = render_consistency(works[i], ready, options);
  for (RenderedAnswer& answer : answers) answer.prepare_ns = (now_ns() - begun) / works.size();
  const std::vector<Source> sampled = resampled(works, options, scratch.sharpened, ready);
  std::vector<Drawn> drawn(works.size());
  draw(works, ready, sampled, options, drawn);
  for (size_t i = 0; i < works.size(); i++) encode(works[i], drawn[i], options, memory(), answers[i]);
  return answers;
}

RenderedAnswer RequestRenderer::render(const Work& work, std::span<const Source> images, const RenderOptions& options,
                                       ImageMemory& scratch, ByteBuffer memory) {
  return std::move(render({&work, 1}, images, options, scratch, [&] { return std::move(memory); }).front());
}

void RequestRenderer::match_gains(Works works, const RenderOptions& options, std::vector<ByteBuffer>& memory,
                                  std::vector<Source>& images, std::vector<RenderedAnswer>& answers) {
  const RequestPlan* const plan = works.front().plan;
  const wire::AnswerHeader& header = works.front().header;
  const ExposureCompensation& gains = gains_.gains_for(*plan->gains());
  std::optional<WideLuma::Seen> seen;
  if (plan->wide()) seen = plan->wide()->see(images_of(works.front(), images), gains, options.parallel);
  if (seen)
    answers.front().brightness = wire::encode_consistency(consistency_header(header, seen->gains), {&seen->moments, 1});
  if (plan->gains()->use) {
    const auto part = [&works](CameraIndex camera) { return united(works, camera, &RequestPlan::drawn_region); };
    images = gains_.match(images, gains, part, memory, options.parallel);
    for (RenderedAnswer& answer : answers) answer.gains = &gains;
  }
  if (seen) gains_.keep(header.sequence, std::move(seen->cameras));
}

}  // namespace lf
