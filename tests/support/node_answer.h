// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <vector>

#include "node/answer_renderer.h"
#include "rig/mesh.h"
#include "support/answer_codec.h"
#include "view/view_request.h"

namespace lf::test {

// The answer of a node with these cameras, all of which see `image`.
inline ByteBuffer node_answer_bytes(const Rig& rig, const ViewRequest& request, const std::vector<CameraIndex>& cameras,
                                    const Image& image, const AnswerForm& form = {}) {
  const RenderJob job(rig, build_mesh(rig, request.out_of_service), request.view, cameras);
  wire::AnswerHeader header;
  header.view_id = request.view_id;
  header.sequence = request.sequence;
  header.view_width = request.view.width;
  header.view_height = request.view.height;
  header.family = image.family();
  header.target_time = header.actual_time = request.target_time;
  header.rig_hash = rig.hash();
  header.cameras = CameraRanges(cameras);
  std::vector<Source> sources;
  for (const CameraIndex camera : job.cameras()) sources.push_back({camera, &rig.cameras[camera], image.view()});
  return render_answer(header, job, sources, form).bytes;
}

// The same in 8 bits.
inline wire::Answer node_answer(const Rig& rig, const ViewRequest& request, const std::vector<CameraIndex>& cameras,
                                const Image& image) {
  return wire::decode_answer(node_answer_bytes(rig, request, cameras, image)).value();
}

}  // namespace lf::test
