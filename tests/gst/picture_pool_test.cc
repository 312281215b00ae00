// SPDX-License-Identifier: LGPL-2.1-or-later
#include "picture_pool.h"

#include <gst/video/video.h>
#include <gtest/gtest.h>

#include <set>
#include <vector>

#include "gst/gst_test.h"
#include "gst_wire.h"

namespace lf::test {
namespace {

constexpr gsize kSize = 16 * 8 * 4;

CapsPtr picture_caps() {
  return CapsPtr(gst_caps_from_string("video/x-raw,format=RGBx,width=16,height=8,framerate=10/1"));
}

// A pool of memory that is somebody's own.
struct OwnPool {
  GstBufferPool parent;
};
struct OwnPoolClass {
  GstBufferPoolClass parent_class;
};
G_DEFINE_TYPE(OwnPool, own_pool, GST_TYPE_BUFFER_POOL)
void own_pool_class_init(OwnPoolClass*) {}
void own_pool_init(OwnPool*) {}

class PicturePoolTest : public testing::Test {
 protected:
  PicturePoolTest() {
    src_ = gst_pad_new("src", GST_PAD_SRC);
    sink_ = gst_pad_new("sink", GST_PAD_SINK);
    gst_object_ref_sink(src_);
    gst_object_ref_sink(sink_);
    gst_pad_set_query_function(sink_, [](GstPad* pad, GstObject*, GstQuery* query) -> gboolean {
      auto* self = static_cast<PicturePoolTest*>(gst_pad_get_element_private(pad));
      if (GST_QUERY_TYPE(query) != GST_QUERY_ALLOCATION || !self->offered_) return FALSE;
      gst_query_add_allocation_pool(query, self->offered_, kSize, 0, self->most_);
      return TRUE;
    });
    gst_pad_set_element_private(sink_, this);
    gst_pad_set_active(src_, TRUE);
    gst_pad_set_active(sink_, TRUE);
    gst_pad_link(src_, sink_);
  }
  ~PicturePoolTest() override {
    gst_object_unref(src_);
    gst_object_unref(sink_);
    gst_clear_object(&offered_);
  }
  GstPad *src_, *sink_;
  GstBufferPool* offered_ = nullptr;
  guint most_ = 0;
};

TEST_F(PicturePoolTest, MemoryServesAgain) {
  PicturePool pool;
  ASSERT_TRUE(pool.configure(src_, picture_caps().get(), kSize));
  std::set<GstBuffer*> seen;
  for (int i = 0; i < 100; i++) {
    BufferPtr picture(pool.take());
    ASSERT_TRUE(picture);
    EXPECT_GE(gst_buffer_get_size(picture.get()), kSize);
    seen.insert(picture.get());
  }
  EXPECT_EQ(seen.size(), 1u);
}

TEST_F(PicturePoolTest, WhatABurstNeededIsGivenBack) {
  PicturePool pool;
  ASSERT_TRUE(pool.configure(src_, picture_caps().get(), kSize));
  std::vector<BufferPtr> burst;
  int freed = 0;
  for (int i = 0; i < 50; i++) {
    burst.emplace_back(pool.take());
    gst_mini_object_weak_ref(
        GST_MINI_OBJECT(gst_buffer_peek_memory(burst.back().get(), 0)),
        [](gpointer count, GstMiniObject*) { ++*static_cast<int*>(count); }, &freed);
  }
  burst.clear();
  EXPECT_EQ(freed, 50 - PicturePool::kMostIdle);
  // As many as lie idle serve again.
  for (int i = 0; i < PicturePool::kMostIdle; i++) burst.emplace_back(pool.take());
  EXPECT_EQ(freed, 50 - PicturePool::kMostIdle);
  burst.clear();
  pool.clear();
  EXPECT_EQ(freed, 50);
}

TEST_F(PicturePoolTest, DownstreamsOwnMemoryIsUsed) {
  offered_ = GST_BUFFER_POOL(g_object_new(own_pool_get_type(), nullptr));
  gst_object_ref_sink(offered_);
  PicturePool pool;
  ASSERT_TRUE(pool.configure(src_, picture_caps().get(), kSize));
  const BufferPtr picture(pool.take());
  EXPECT_EQ(picture->pool, offered_);
}

TEST_F(PicturePoolTest, APoolThatMayRunOutIsNot) {
  offered_ = GST_BUFFER_POOL(g_object_new(own_pool_get_type(), nullptr));
  gst_object_ref_sink(offered_);
  most_ = 3;
  PicturePool pool;
  ASSERT_TRUE(pool.configure(src_, picture_caps().get(), kSize));
  std::vector<BufferPtr> pictures;
  for (int i = 0; i < 10; i++) pictures.emplace_back(pool.take());
  for (const BufferPtr& picture : pictures) ASSERT_TRUE(picture);
  EXPECT_NE(pictures[0]->pool, offered_);
}

TEST(AnswerMemory, ShrinksWithTheAnswers) {
  AnswerMemory memory;
  const auto answer = [&memory](size_t size) {
    ByteBuffer bytes = memory.take();
    bytes.resize(size);
    memory.give_back(std::move(bytes));
  };
  for (int i = 0; i < 10; i++) answer(1'000'000);
  EXPECT_GE(memory.kept_bytes(), 1'000'000u);
  for (int i = 0; i < 100; i++) answer(1000);
  EXPECT_LE(memory.kept_bytes(), 4 * 2000u);
  EXPECT_GT(memory.kept_bytes(), 0u) << "and still serves again";
}

}  // namespace
}  // namespace lf::test
