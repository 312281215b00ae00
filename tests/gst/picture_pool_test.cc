// SPDX-License-Identifier: LGPL-2.1-or-later
#include "compositor/picture_pool.h"

#include <gst/video/video.h>

#include "gst/gst_test.h"

namespace lf::test {
namespace {

constexpr gsize kSize = 16 * 8 * 4;

CapsPtr picture_caps() {
  return CapsPtr(gst_caps_from_string("video/x-raw,format=RGBx,width=16,height=8,framerate=10/1"));
}

// A custom buffer pool, as a downstream element may offer.
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
  ~PicturePoolTest() override {
    pool_.clear();
    if (chosen_) gst_buffer_pool_set_active(chosen_, FALSE);
    gst_clear_object(&chosen_);
    gst_clear_object(&offered_);
  }
  bool decide() {
    g_autoptr(GstQuery) query = gst_query_new_allocation(picture_caps().get(), TRUE);
    if (offered_) gst_query_add_allocation_pool(query, offered_, kSize, least_, most_);
    const bool decided = pool_.decide(query);
    if (decided) gst_query_parse_nth_allocation_pool(query, 0, &chosen_, nullptr, nullptr, nullptr);
    return decided;
  }
  void offer(GType type) {
    offered_ = GST_BUFFER_POOL(g_object_new(type, nullptr));
    gst_object_ref_sink(offered_);
  }
  BufferPtr take() { return BufferPtr(pool_.take(chosen_)); }

  PicturePool pool_;
  GstBufferPool *chosen_ = nullptr, *offered_ = nullptr;
  guint least_ = 0, most_ = 0;
};

TEST_F(PicturePoolTest, MemoryIsReused) {
  ASSERT_TRUE(decide());
  std::set<GstBuffer*> seen;
  for (int i = 0; i < 100; i++) {
    const BufferPtr picture = take();
    ASSERT_TRUE(picture);
    EXPECT_GE(gst_buffer_get_size(picture.get()), kSize);
    seen.insert(picture.get());
  }
  EXPECT_EQ(seen.size(), 1u);
}

TEST_F(PicturePoolTest, MemoryOfABurstIsFreed) {
  ASSERT_TRUE(decide());
  std::vector<BufferPtr> burst;
  int freed = 0;
  for (int i = 0; i < 50; i++) {
    burst.push_back(take());
    gst_mini_object_weak_ref(
        GST_MINI_OBJECT(gst_buffer_peek_memory(burst.back().get(), 0)),
        [](gpointer count, GstMiniObject*) { ++*static_cast<int*>(count); }, &freed);
  }
  burst.clear();
  constexpr int kIdle = PicturePool::kMaxIdle;
  EXPECT_EQ(freed, 50 - kIdle);
  for (int i = 0; i < kIdle; i++) burst.push_back(take());
  EXPECT_EQ(freed, 50 - kIdle);
  burst.clear();
  pool_.clear();
  gst_buffer_pool_set_active(chosen_, FALSE);
  EXPECT_EQ(freed, 50);
}

TEST_F(PicturePoolTest, UsesTheDownstreamPool) {
  offer(own_pool_get_type());
  ASSERT_TRUE(decide());
  EXPECT_EQ(take()->pool, offered_);
}

TEST_F(PicturePoolTest, UsesTheDownstreamAllocationParameters) {
  offer(GST_TYPE_VIDEO_BUFFER_POOL);
  ASSERT_TRUE(decide());
  EXPECT_EQ(take()->pool, offered_);
}

// The pool keeps only a few of the buffers that a burst needed.
TEST_F(PicturePoolTest, UnlimitedPoolsAreLimited) {
  offer(GST_TYPE_VIDEO_BUFFER_POOL);
  least_ = 2;
  ASSERT_TRUE(decide());
  std::vector<BufferPtr> burst;
  for (int i = 0; i < 50; i++) burst.push_back(take());
  const auto theirs = std::ranges::count_if(burst, [&](const BufferPtr& b) { return b->pool == offered_; });
  EXPECT_EQ(theirs, least_ + PicturePool::kMaxIdle);
}

TEST_F(PicturePoolTest, ExhaustedPoolDoesNotBlock) {
  offer(own_pool_get_type());
  most_ = 3;
  ASSERT_TRUE(decide());
  std::vector<BufferPtr> pictures;
  for (int i = 0; i < 10; i++) pictures.push_back(take());
  for (const BufferPtr& picture : pictures) ASSERT_TRUE(picture);
  EXPECT_EQ(std::ranges::count_if(pictures, [&](const BufferPtr& b) { return b->pool == offered_; }), 3);
  pictures.clear();
  EXPECT_EQ(take()->pool, offered_) << "room again";
}

TEST_F(PicturePoolTest, UnconfigurablePoolIsSkipped) {
  offer(own_pool_get_type());
  GstStructure* config = gst_buffer_pool_get_config(offered_);
  gst_buffer_pool_config_set_params(config, picture_caps().get(), kSize / 2, 0, 0);
  ASSERT_TRUE(gst_buffer_pool_set_config(offered_, config));
  ASSERT_TRUE(gst_buffer_pool_set_active(offered_, TRUE));
  ASSERT_TRUE(decide());
  const BufferPtr picture = take();
  ASSERT_TRUE(picture);
  EXPECT_NE(picture->pool, offered_);
  gst_buffer_pool_set_active(offered_, FALSE);
}

}  // namespace
}  // namespace lf::test
