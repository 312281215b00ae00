// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <memory>

#include <gst/gst.h>

#include "render/gl/card_sum.h"

namespace lf {

// Memory of a sum on a graphics card, owned by the caller: the payload of a fragment of the whole view in 16 bits. It
// comes here when it is mapped, which whoever knows nothing of cards does; to be read alone.
GstMemory* card_memory_new(std::shared_ptr<gl::CardSum> sum);

// The sum whose memory follows the first memory of an answer; null if none does.
std::shared_ptr<gl::CardSum> card_sum_of(GstBuffer* answer);

}  // namespace lf
