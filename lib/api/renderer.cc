// SPDX-License-Identifier: LGPL-2.1-or-later
#include <lightfield/renderer.h>

#include <algorithm>
#include <numeric>

#include "api/convert.h"
#include "api/local_node.h"
#include "api/view_composer.h"

namespace lightfield {
namespace {

std::vector<uint32_t> all_cameras(const Rig& rig) {
  std::vector<uint32_t> cameras(rig.size());
  std::iota(cameras.begin(), cameras.end(), 0);
  return cameras;
}

}  // namespace

struct [[gnu::visibility("hidden")]] Renderer::State {
  State(Rig of, unsigned threads)
      : rig(std::move(of)),
        node(rig.data().rig, rig.data().hash, all_cameras(rig), threads),
        composer(rig.data().rig, rig.data().hash, 0) {}
  const Rig rig;
  lf::api::LocalNode node;
  lf::api::ViewComposer composer;
  lf::ByteBuffer memory;  // of the latest answer

  std::vector<uint32_t> cameras(const View& view) {
    lf::ViewRequest request;
    request.view = lf::api::to_view(view);
    return node.plan(request)->cameras();
  }
  // Those without an image, if the view needs one of them: for the others nobody has to have one.
  std::vector<uint32_t> missing(const View& view, const std::vector<ImageView>& images) {
    std::vector<uint32_t> missing;
    for (uint32_t i = 0; i < images.size(); i++)
      if (images[i].format == PixelFormat::kNone) missing.push_back(i);
    if (missing.empty()) return missing;
    const std::vector<uint32_t> needed = cameras(view);
    const bool any = std::ranges::any_of(needed, [&](uint32_t i) { return images[i].format == PixelFormat::kNone; });
    return any ? missing : std::vector<uint32_t>();
  }
};

Renderer::Renderer(Rig rig, unsigned threads) : state_(std::make_unique<State>(std::move(rig), threads)) {}
Renderer::~Renderer() = default;
Renderer::Renderer(Renderer&&) noexcept = default;
Renderer& Renderer::operator=(Renderer&&) noexcept = default;

const Rig& Renderer::rig() const { return state_->rig; }

std::vector<uint32_t> Renderer::cameras(const View& view) const { return state_->cameras(view); }

Image Renderer::render(const View& view, const std::vector<ImageView>& images, const RenderOptions& options) {
  lf::api::check_count(images.size(), state_->rig.size());
  RequestOptions asked;
  asked.focus = options.focus;
  asked.nearest = options.nearest;
  asked.farthest = options.farthest;
  asked.match_brightness = options.match_brightness;
  asked.background = options.background;
  asked.quality = 0;
  asked.out_of_service = state_->missing(view, images);
  lf::api::ViewComposer& composer = state_->composer;
  const lf::ViewRequest& request = composer.begin(view, asked);
  const auto units = std::make_shared<lf::AnswerMaker::Units>(
      state_->node.answer(request, images, options.resampling, true, std::move(state_->memory), options.drawn_by));
  for (const lf::ByteBuffer* unit : {&units->brightness, &units->tried.unit, &units->answer.bytes})
    if (!unit->empty()) composer.add(*unit, units);
  Image picture = composer.finish();
  state_->memory = std::move(units->answer.bytes);
  return picture;
}

Image Renderer::render(const View& view, const std::vector<Image>& images, const RenderOptions& options) {
  return render(view, std::vector<ImageView>(images.begin(), images.end()), options);
}

std::string Renderer::drawn_by() const { return state_->node.drawn_by(); }

void Renderer::reset_focus() { state_->composer.reset_focus(); }

}  // namespace lightfield
