// SPDX-License-Identifier: LGPL-2.1-or-later
// Viewers without decoding, for measuring lf-serve without the cost of browsers:
//     watch URL VIEWERS WIDTH HEIGHT SECONDS [LOCAL-ADDRESS [QUERY]]
// Prints a line of JSON: frames per second of each viewer, and total bits per second.
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <memory>
#include <vector>

#include "web/whep_client.h"

int main(int argc, char** argv) {
  gst_init(&argc, &argv);
  if (argc < 6 || argc > 8) {
    std::fprintf(stderr, "usage: watch URL VIEWERS WIDTH HEIGHT SECONDS [LOCAL-ADDRESS [QUERY]]\n");
    return 2;
  }
  try {
    lf::test::WhepClient::Options options{argv[1], std::atoi(argv[3]), std::atoi(argv[4])};
    if (argc > 6) options.address = argv[6];
    if (argc > 7) options.query = argv[7];
    std::vector<std::unique_ptr<lf::test::WhepClient>> viewers;
    for (int i = 0; i < std::atoi(argv[2]); i++) {
      viewers.push_back(std::make_unique<lf::test::WhepClient>(options));
      viewers.back()->send(
          "{\"id\":1,\"request\":{\"type\":\"customUpstreamEvent\",\"structureName\":"
          "\"lightfield-view-request\",\"structure\":{\"yaw\":" +
          std::to_string(i % 8 - 4) + "}}}");
    }
    std::vector<uint64_t> before;
    uint64_t bytes = 0;
    g_usleep(1000000);
    std::printf("ready\n");
    std::fflush(stdout);
    const gint64 began = g_get_monotonic_time();
    for (const auto& viewer : viewers) before.push_back(viewer->pictures()), bytes -= viewer->bytes();
    g_usleep(static_cast<gulong>(std::atof(argv[5]) * 1e6));
    const double seconds = static_cast<double>(g_get_monotonic_time() - began) * 1e-6;
    std::printf("{\"rates\":[");
    for (size_t i = 0; i < viewers.size(); i++)
      std::printf("%s%.2f", i ? "," : "", static_cast<double>(viewers[i]->pictures() - before[i]) / seconds);
    for (const auto& viewer : viewers) bytes += viewer->bytes();
    std::printf("],\"bitsPerSecond\":%.0f}\n", 8 * static_cast<double>(bytes) / seconds);
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "watch: %s\n", error.what());
    return 1;
  }
}
