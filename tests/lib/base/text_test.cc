// SPDX-License-Identifier: LGPL-2.1-or-later
#include "base/text.h"
#include "support/expect_error.h"
#include "support/test.h"

namespace lf {
namespace {

TEST(NaturalOrder, NumbersCompareAsNumbers) {
  std::vector<std::string> sorted = {"", "0", "7", "07x", "10", "cam"};
  for (const char* end :
       {"1", "1_2", "1_10", "2", "10", "010_1", "11", "99999999999999999999998", "99999999999999999999999", "era"})
    sorted.push_back(std::string("cam") + end);
  std::vector<std::string> mixed = sorted;
  std::ranges::reverse(mixed);
  std::ranges::sort(mixed, natural_less);
  EXPECT_EQ(mixed, sorted);
}

TEST(NaturalOrder, IsAStrictOrder) {
  const std::string names[] = {"a1", "a01", "a001", "a1b", "a01b", "b", "a", "1", "01", ""};
  for (const std::string& a : names) {
    EXPECT_FALSE(natural_less(a, a)) << a;
    for (const std::string& b : names) {
      if (a == b) continue;
      EXPECT_NE(natural_less(a, b), natural_less(b, a)) << a << " " << b;
      for (const std::string& c : names) {
        const bool ascends = natural_less(a, b) && natural_less(b, c);
        EXPECT_TRUE(!ascends || natural_less(a, c)) << a << " " << b << " " << c;
      }
    }
  }
}

TEST(HostList, PortsWithAndWithoutHosts) {
  EXPECT_THAT(parse_host_ports(""), IsEmpty());
  EXPECT_THAT(parse_host_ports("6000,viewer:6001,239.1.2.3:65535,[::1]:7,::1:8"),
              ElementsAre(HostPort{"", 6000}, HostPort{"viewer", 6001}, HostPort{"239.1.2.3", 65535},
                          HostPort{"::1", 7}, HostPort{"::1", 8}));
}

TEST(HostList, Nodes) {
  EXPECT_THAT(parse_nodes(""), IsEmpty());
  EXPECT_THAT(parse_nodes("camhost:6000:6100,10.0.0.1:1:65535,[fe80::1]:6000:6101"),
              ElementsAre(NodeAddress{"camhost", 6000, "", 6100}, NodeAddress{"10.0.0.1", 1, "", 65535},
                          NodeAddress{"fe80::1", 6000, "", 6101}));
  EXPECT_THAT(
      parse_nodes("camhost:6000:10.0.0.5:6100,[fe80::1]:6000:[fe80::2]:6101"),
      ElementsAre(NodeAddress{"camhost", 6000, "10.0.0.5", 6100}, NodeAddress{"fe80::1", 6000, "fe80::2", 6101}));
}

TEST(HostList, ErrorsNameTheInvalidItem) {
  for (const std::string bad : {"host", "host:", ":6000", "host:0", "host:65536", "host:12a", "host:-1", "host: 1"})
    EXPECT_ERROR(parse_host_ports("6000," + bad), bad, "PORT or HOST:PORT");
  for (const std::string bad : {"host:6000", ":6000:6001", "6000:6001", "host:6000:0", "host:x:6000", "host:6000:6001 ",
                                "host:10.0.0.5:6001", "host:x:10.0.0.5:6001", ":6000:10.0.0.5:6001"})
    EXPECT_ERROR(parse_nodes("a:1:2," + bad), bad, "HOST:PORT-THERE:[ADDRESS-HERE:]PORT-HERE");
  EXPECT_ERROR(parse_host_ports("1,,2"), "PORT or HOST:PORT");
}

}  // namespace
}  // namespace lf
