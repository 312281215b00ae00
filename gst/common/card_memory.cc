// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/card_memory.h"

#include <exception>
#include <utility>

#include "image/image.h"

namespace {

struct CardMemory {
  GstMemory parent;
  std::shared_ptr<lf::gl::CardSum>* sum;
};

struct LfCardAllocator {
  GstAllocator parent;
};
struct LfCardAllocatorClass {
  GstAllocatorClass parent_class;
};

G_DEFINE_TYPE(LfCardAllocator, lf_card_allocator, GST_TYPE_ALLOCATOR)

lf::gl::CardSum& sum_of(GstMemory* memory) { return **reinterpret_cast<CardMemory*>(memory)->sum; }

gpointer map(GstMemory* memory, gsize, GstMapFlags) {
  try {
    // All of it lies behind the first plane, without gaps.
    return const_cast<int16_t*>(sum_of(memory).fetch().plane[0]);
  } catch (const std::exception& error) {
    GST_WARNING("a sum can't be fetched: %s", error.what());
    return nullptr;
  }
}

void unmap(GstMemory*) {}

// There is nothing to share parts of.
GstMemory* share(GstMemory*, gssize, gssize) { return nullptr; }

void free_memory(GstAllocator*, GstMemory* memory) {
  auto* const self = reinterpret_cast<CardMemory*>(memory);
  delete self->sum;
  g_free(self);
}

GstMemory* alloc(GstAllocator*, gsize, GstAllocationParams*) { return nullptr; }

void lf_card_allocator_class_init(LfCardAllocatorClass* klass) {
  GstAllocatorClass* const allocator_class = GST_ALLOCATOR_CLASS(klass);
  allocator_class->alloc = alloc;
  allocator_class->free = free_memory;
}

void lf_card_allocator_init(LfCardAllocator* self) {
  GstAllocator* const allocator = GST_ALLOCATOR(self);
  allocator->mem_type = "LightfieldSum";
  allocator->mem_map = map;
  allocator->mem_unmap = unmap;
  allocator->mem_share = share;
  GST_OBJECT_FLAG_SET(self, GST_ALLOCATOR_FLAG_CUSTOM_ALLOC);
}

// Lives as long as the process.
GstAllocator* allocator() {
  static GstAllocator* const allocator = [] {
    auto* const made = GST_ALLOCATOR(gst_object_ref_sink(g_object_new(lf_card_allocator_get_type(), nullptr)));
    GST_OBJECT_FLAG_SET(made, GST_OBJECT_FLAG_MAY_BE_LEAKED);
    return made;
  }();
  return allocator;
}

}  // namespace

namespace lf {

GstMemory* card_memory_new(std::shared_ptr<gl::CardSum> sum) {
  const Rect& rect = sum->rect();
  const size_t pixels = static_cast<size_t>(rect.width()) * rect.height(),
               samples = packed_size(sum->family(), rect.width(), rect.height()) + (sum->has_lost() ? pixels : 0),
               bytes = 2 * samples;
  auto* const memory = g_new0(CardMemory, 1);
  gst_memory_init(&memory->parent, GST_MEMORY_FLAG_READONLY, allocator(), nullptr, bytes, 1, 0, bytes);
  memory->sum = new std::shared_ptr<gl::CardSum>(std::move(sum));
  return &memory->parent;
}

std::shared_ptr<gl::CardSum> card_sum_of(GstBuffer* answer) {
  if (gst_buffer_n_memory(answer) != 2) return nullptr;
  GstMemory* const memory = gst_buffer_peek_memory(answer, 1);
  return memory->allocator == allocator() ? *reinterpret_cast<CardMemory*>(memory)->sum : nullptr;
}

}  // namespace lf
