// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/gst_wire.h"

#include <algorithm>
#include <exception>
#include <utility>

#include "image/image.h"
#include "wire/consistency_codec.h"

namespace {

struct GpuSumMemory {
  GstMemory parent;
  std::shared_ptr<lf::gl::GpuSum>* sum;
};

struct LfGpuSumAllocator {
  GstAllocator parent;
};
struct LfGpuSumAllocatorClass {
  GstAllocatorClass parent_class;
};

G_DEFINE_TYPE(LfGpuSumAllocator, lf_gpu_sum_allocator, GST_TYPE_ALLOCATOR)

lf::gl::GpuSum& sum_of(GstMemory* memory) { return **reinterpret_cast<GpuSumMemory*>(memory)->sum; }

gpointer map(GstMemory* memory, gsize, GstMapFlags) {
  try {
    // One pointer is sufficient, because all planes are contiguous.
    return const_cast<int16_t*>(sum_of(memory).fetch().plane[0]);
  } catch (const std::exception& error) {
    GST_WARNING("can't download rendered pixels from the GPU: %s", error.what());
    return nullptr;
  }
}

void unmap(GstMemory*) {}

GstMemory* share(GstMemory*, gssize, gssize) { return nullptr; }

void free_memory(GstAllocator*, GstMemory* memory) {
  auto* const self = reinterpret_cast<GpuSumMemory*>(memory);
  delete self->sum;
  g_free(self);
}

GstMemory* alloc(GstAllocator*, gsize, GstAllocationParams*) { return nullptr; }

void lf_gpu_sum_allocator_class_init(LfGpuSumAllocatorClass* klass) {
  GstAllocatorClass* const allocator_class = GST_ALLOCATOR_CLASS(klass);
  allocator_class->alloc = alloc;
  allocator_class->free = free_memory;
}

void lf_gpu_sum_allocator_init(LfGpuSumAllocator* self) {
  GstAllocator* const allocator = GST_ALLOCATOR(self);
  allocator->mem_type = "LightfieldSum";
  allocator->mem_map = map;
  allocator->mem_unmap = unmap;
  allocator->mem_share = share;
  GST_OBJECT_FLAG_SET(self, GST_ALLOCATOR_FLAG_CUSTOM_ALLOC);
}

GstAllocator* allocator() {
  static GstAllocator* const allocator = [] {
    auto* const made = GST_ALLOCATOR(gst_object_ref_sink(g_object_new(lf_gpu_sum_allocator_get_type(), nullptr)));
    GST_OBJECT_FLAG_SET(made, GST_OBJECT_FLAG_MAY_BE_LEAKED);
    return made;
  }();
  return allocator;
}

}  // namespace

namespace lf {

GstMemory* gpu_sum_memory_new(std::shared_ptr<gl::GpuSum> sum) {
  const Rect& rect = sum->rect();
  const size_t pixels = static_cast<size_t>(rect.width()) * rect.height(),
               samples = packed_size(sum->family(), rect.width(), rect.height()) + (sum->has_missing() ? pixels : 0),
               bytes = 2 * samples;
  auto* const memory = g_new0(GpuSumMemory, 1);
  gst_memory_init(&memory->parent, GST_MEMORY_FLAG_READONLY, allocator(), nullptr, bytes, 1, 0, bytes);
  memory->sum = new std::shared_ptr<gl::GpuSum>(std::move(sum));
  return &memory->parent;
}

std::shared_ptr<gl::GpuSum> gpu_sum_of(GstBuffer* answer) {
  if (gst_buffer_n_memory(answer) != 2) return nullptr;
  GstMemory* const memory = gst_buffer_peek_memory(answer, 1);
  return memory->allocator == allocator() ? *reinterpret_cast<GpuSumMemory*>(memory)->sum : nullptr;
}

namespace {

template <class Decode>
auto decode(GstBuffer* buffer, std::string* reason, Decode decode_bytes) -> decltype(decode_bytes({}, reason)) {
  return decode_bytes(MappedBuffer(buffer, MappedBuffer::Part::kHead).bytes(), reason);
}

template <class Owner, class Bytes>
GstBuffer* wrap(Owner* owner, Bytes& bytes) {
  return gst_buffer_new_wrapped_full(GstMemoryFlags(0), bytes.data(), bytes.size(), 0, bytes.size(), owner,
                                     [](gpointer data) { delete static_cast<Owner*>(data); });
}

struct OwnedAnswer {
  ByteBuffer bytes;
  std::shared_ptr<AnswerMemory> memory;
  ~OwnedAnswer() { memory->give_back(std::move(bytes)); }
};

}  // namespace

MappedBuffer::MappedBuffer(GstBuffer* buffer, Part part) : buffer_(gst_buffer_ref(buffer)) {
  const gint memories = part == Part::kHead && gpu_sum_of(buffer) ? 1 : -1;
  if (!gst_buffer_map_range(buffer, 0, memories, &map_, GST_MAP_READ)) map_ = {};
}
MappedBuffer::~MappedBuffer() {
  if (map_.memory) gst_buffer_unmap(buffer_, &map_);
  gst_buffer_unref(buffer_);
}

std::optional<ViewRequest> decode_request_buffer(GstBuffer* buffer, std::string* reason) {
  return decode(buffer, reason, wire::decode_request);
}
std::optional<wire::AnyRequest> decode_any_request_buffer(GstBuffer* buffer, std::string* reason) {
  return decode(buffer, reason, wire::decode_any_request);
}
std::optional<uint32_t> peek_answer_view(GstBuffer* buffer) {
  return wire::peek_answer_view(MappedBuffer(buffer, MappedBuffer::Part::kHead).bytes());
}
bool is_consistency_buffer(GstBuffer* buffer) {
  const MappedBuffer mapped(buffer, MappedBuffer::Part::kHead);
  return wire::is_consistency(mapped.bytes());
}
std::optional<wire::AnswerPartHeader> parse_answer_buffer_header(GstBuffer* buffer, std::string* reason) {
  return decode(buffer, reason, wire::parse_answer_header);
}

GstBuffer* encode_request_buffer(const ViewRequest& request) { return wrap_bytes(wire::encode_request(request)); }
GstBuffer* wrap_bytes(std::vector<uint8_t> bytes) {
  auto* owned = new std::vector<uint8_t>(std::move(bytes));
  return wrap(owned, *owned);
}
GstBuffer* wrap_bytes(ByteBuffer bytes) {
  auto* owned = new ByteBuffer(std::move(bytes));
  return wrap(owned, *owned);
}
GstBuffer* wrap_answer(ByteBuffer bytes, std::shared_ptr<AnswerMemory> memory, std::shared_ptr<gl::GpuSum> payload) {
  auto* owned = new OwnedAnswer{std::move(bytes), std::move(memory)};
  GstBuffer* answer = wrap(owned, owned->bytes);
  if (payload) gst_buffer_append_memory(answer, gpu_sum_memory_new(std::move(payload)));
  return answer;
}

}  // namespace lf
