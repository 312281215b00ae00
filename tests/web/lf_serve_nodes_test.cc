// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-serve with the cameras of another host, under a key.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <string>

#include "gst/gst_test.h"
#include "support/free_port.h"
#include "web/served.h"
#include "web/whep_client.h"

namespace lf::test {
namespace {

using testing::HasSubstr;
using testing::Not;

// A file with a secret.
class KeyFile : public TempFile {
 public:
  explicit KeyFile(char character) : TempFile(std::vector<uint8_t>(40, static_cast<uint8_t>(character))) {
    chmod(path().c_str(), 0600);
  }
};

class LfServeNodes : public testing::Test {
 protected:
  void start_host(const std::string& rig, const KeyFile& key) {
    host_ = launch("lfnodesink name=n rig=" + rig + " listen=127.0.0.1:" + std::to_string(there_) +
                   " answers=127.0.0.1:" + std::to_string(here_) + " key-file=" + key.path());
    ASSERT_TRUE(host_);
    ASSERT_NE(gst_element_set_state(host_.get(), GST_STATE_PLAYING), GST_STATE_CHANGE_FAILURE);
  }
  void stop_host() {
    if (host_) gst_element_set_state(host_.get(), GST_STATE_NULL);
    host_.reset();
  }
  void TearDown() override { stop_host(); }
  // What the host counts of requests.
  uint64_t requests(const char* field) {
    const ElementPtr gate(gst_bin_get_by_name(GST_BIN(host_.get()), "requests0_gate"));
    return stat(gate.get(), field);
  }
  std::vector<std::string> options(const KeyFile& key) const {
    return {"--nodes", "127.0.0.1:" + std::to_string(there_) + ":127.0.0.1:" + std::to_string(here_), "--key-file",
            key.path()};
  }
  static double camera_bytes(const Served& served) { return std::stod(served.metric("camera_bytes_total")); }

  const int there_ = free_port(SOCK_DGRAM), here_ = free_port(SOCK_DGRAM);
  const KeyFile key_{'k'}, other_{'o'};
  ElementPtr host_;
};

TEST_F(LfServeNodes, ServeThoseWhoHaveTheirKey) {
  Served served(options(key_));
  ASSERT_NE(served.url(), "") << served.said();
  start_host(served.rig(), key_);
  const WhepClient client({.url = served.url()});
  EXPECT_TRUE(becomes([&] { return requests("passed") > 5 && camera_bytes(served) > 0; }));
  EXPECT_EQ(requests("forged"), 0u);
  stop_host();
  start_host(served.rig(), other_);
  EXPECT_TRUE(becomes([&] { return requests("forged") > 5; }));
  EXPECT_EQ(requests("passed"), 0u);
  EXPECT_EQ(served.stop(), 0);
}

// Who it is that does not answer, and that it does again.
TEST_F(LfServeNodes, AreNamedWhenTheyDoNotAnswer) {
  Served served(options(key_));
  ASSERT_NE(served.url(), "") << served.said();
  const std::string name = "127.0.0.1:" + std::to_string(there_), metric = "node_silent{node=\"" + name + "\"}";
  start_host(served.rig(), key_);
  const WhepClient client({.url = served.url()});
  EXPECT_TRUE(becomes([&] { return camera_bytes(served) > 0 && served.metric(metric) == "0"; }));
  EXPECT_THAT(served.said(), Not(HasSubstr(name + " does not answer")));
  stop_host();
  EXPECT_TRUE(becomes([&] { return served.metric(metric) == "1"; }));
  EXPECT_TRUE(
      becomes([&] { return served.said().find("cameras: " + name + " does not answer\n") != std::string::npos; }));
  start_host(served.rig(), key_);
  EXPECT_TRUE(
      becomes([&] { return served.said().find("cameras: " + name + " answers again\n") != std::string::npos; }));
  EXPECT_EQ(served.metric(metric), "0");
}

TEST_F(LfServeNodes, SayWhatIsWrongWithAKey) {
  const Served served({"--nodes", "127.0.0.1:6000:6100", "--key-file", "/nowhere/key"});
  EXPECT_EQ(served.url(), "");
  EXPECT_THAT(served.said(), HasSubstr("/nowhere/key: can't be read"));
}

}  // namespace
}  // namespace lf::test
