// SPDX-License-Identifier: LGPL-2.1-or-later
#include "bins/discovery.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/rigs.h"

namespace lf {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

const std::string kClient = "client0=10.0.0.3:6000:10.0.0.11:6100";

TEST(Discovery, ParsesAnnouncements) {
  const auto host = parse_announcement({"txtvers=1", "rig=00000000000000ab", "cameras=0-3,7", kClient, "flag",
                                        "client1=[fd00::3]:6001:[fd00::12]:6100"});
  ASSERT_TRUE(host);
  EXPECT_EQ(host->rig, "00000000000000ab");
  EXPECT_EQ(host->cameras, "0-3,7");
  EXPECT_THAT(host->clients, ElementsAre(NodeAddress{"10.0.0.3", 6000, "10.0.0.11", 6100},
                                         NodeAddress{"fd00::3", 6001, "fd00::12", 6100}));
  for (const std::vector<std::string>& fields : std::vector<std::vector<std::string>>{
           {},
           {"cameras=0", kClient},
           {"rig=ab", kClient},
           {"rig=ab", "cameras=0"},
           {"rig=ab", "cameras=0", "client0="},
           {"rig=ab", "cameras=0", "client0=10.0.0.3:6000"},
           {"rig=ab", "cameras=0", "client0=10.0.0.3:6000:6100"},           // for any client
           {"rig=ab", "cameras=0", "client0=camhost:6000:10.0.0.11:6100"},  // a name instead of an address
           {"rig=ab", "cameras=0", kClient, "client1=10.0.0.3:0:10.0.0.11:6100"}})
    EXPECT_FALSE(parse_announcement(fields)) << testing::PrintToString(fields);
}

TEST(Discovery, SelectsTheConnectionsToThisMachine) {
  const Rig rig = test::camera_grid(2, 2, 0.1, 160, 120, 200);
  const std::string hash = rig_hash_text(rig);
  const auto host = [&](const std::string& of_rig, const std::string& cameras, int number) {
    const std::string at = "10.0.0." + std::to_string(number);
    return *parse_announcement({"rig=" + of_rig, "cameras=" + cameras, "client0=" + at + ":6000:10.0.0.11:6100",
                                "client1=" + at + ":6001:[FD00:0::12]:6101"});
  };
  const std::set<std::string> first = {"127.0.0.1", "10.0.0.11"}, second = {"fd00::12"};
  const std::set<CameraIndex> all = {0, 1, 2, 3};
  const NodeAddress a{"10.0.0.1", 6000, "10.0.0.11", 6100}, b{"10.0.0.2", 6000, "10.0.0.11", 6100};
  const struct {
    const char* name;
    std::vector<AnnouncedHost> hosts;
    std::vector<NodeAddress> connections;
    std::set<CameraIndex> missing;
  } cases[] = {{"none", {}, {}, all},
               {"two hosts", {host(hash, "0,1", 1), host(hash, "2-3", 2)}, {a, b}, {}},
               {"one host on two networks", {host(hash, "0,1", 1), host(hash, "0,1", 1)}, {a}, {2, 3}},
               {"a camera of two hosts", {host(hash, "0,1", 1), host(hash, "1-3", 2)}, {a}, {2, 3}},
               {"another rig", {host("0000000000000001", "0-3", 1), host(hash, "2-3", 2)}, {b}, {0, 1}},
               {"unknown cameras", {host(hash, "3-4", 1), host(hash, "x", 1), host(hash, "0-3", 2)}, {b}, {}}};
  for (const auto& [name, hosts, connections, missing] : cases) {
    std::set<CameraIndex> left = all;
    EXPECT_EQ(connections_to(first, rig, hosts, left), connections) << name;
    EXPECT_EQ(left, missing) << name;
  }
  std::set<CameraIndex> left = all;
  EXPECT_THAT(connections_to(second, rig, {host(hash, "0-3", 1)}, left),
              ElementsAre(NodeAddress{"10.0.0.1", 6001, "FD00:0::12", 6101}));
  EXPECT_THAT(connections_to({"10.0.0.12"}, rig, {host(hash, "0-3", 1)}, left), IsEmpty());
}

TEST(Discovery, KeepsOtherTexts) {
  const auto warn = [](const std::string& text) { ADD_FAILURE() << text; };
  EXPECT_THAT(find_nodes("camhost:6000:6100", Rig(), warn), ElementsAre(NodeAddress{"camhost", 6000, "", 6100}));
  EXPECT_THAT(find_nodes("", Rig(), warn), IsEmpty());
}

}  // namespace
}  // namespace lf
