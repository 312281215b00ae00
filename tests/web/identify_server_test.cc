// SPDX-License-Identifier: LGPL-2.1-or-later
#include "cameras/identify_server.h"

#include <arpa/inet.h>
#include <sys/socket.h>
#include <sys/time.h>

#include "support/process.h"
#include "support/test.h"

namespace lf::test {
namespace {

long resident_megabytes() { return resident_kib() / 1024; }

class IdentifyServerTest : public testing::Test {
 protected:
  static constexpr std::chrono::seconds kPatience{20};
  // Sends the body repeatedly and returns the response, or "" after a timeout.
  std::string post(const std::string& path, const std::string& headers, const std::string& body, int times = 1) {
    return request("POST", path, headers, body, times);
  }
  std::string request(const std::string& method, const std::string& path, const std::string& headers,
                      const std::string& body = "", int times = 1) {
    const std::string host = server_.url().substr(7, server_.url().size() - 8);
    const std::string head = method + " " + path + " HTTP/1.1\r\nHost: " + host + "\r\n" + headers + "\r\n";
    std::atomic<bool> done = false;
    std::string response;
    std::thread client([&] {
      response = ask(std::stoi(host.substr(host.find(':') + 1)), head, body, times);
      done = true;
      g_main_context_wakeup(nullptr);
    });
    while (!done) g_main_context_iteration(nullptr, TRUE);
    client.join();
    return response;
  }

  std::atomic<long> most_resident_ = 0;
  std::string swapped_;
  cameras::IdentifyServer server_{0,
                                  {.jpeg = [] { return std::vector<uint8_t>{}; },
                                   .state = [] { return std::string("{}"); },
                                   .swap =
                                       [this](uint32_t a, uint32_t b) {
                                         swapped_ = std::to_string(a) + " and " + std::to_string(b);
                                         return std::string();
                                       }}};

 private:
  std::string ask(int port, const std::string& head, const std::string& body, int times) {
    const int socket = ::socket(AF_INET, SOCK_STREAM, 0);
    const timeval patience{.tv_sec = kPatience.count(), .tv_usec = 0};
    setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(static_cast<uint16_t>(port));
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const auto sends = [socket](const std::string& bytes) {
      for (size_t sent = 0; sent < bytes.size();) {
        const ssize_t more = send(socket, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
        if (more <= 0) return false;
        sent += static_cast<size_t>(more);
      }
      return true;
    };
    bool open = connect(socket, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0 && sends(head);
    for (int i = 0; i < times && open; i++) {
      open = sends(body);
      most_resident_ = std::max(most_resident_.load(), resident_megabytes());
    }
    char buffer[2000];
    const ssize_t size = recv(socket, buffer, sizeof buffer, 0);
    close(socket);
    return size > 0 ? std::string(buffer, static_cast<size_t>(size)) : "";
  }
};

// Pages of other sites can send any body. The server rejects it by its length and stores nothing.
TEST_F(IdentifyServerTest, DiscardsLongBodies) {
  const std::string piece(1'000'000, 'x');
  const long before = resident_megabytes();
  EXPECT_THAT(post("/anything", "Content-Type: text/plain\r\nContent-Length: 100000000\r\n", piece, 100),
              StartsWith("HTTP/1.1 413"));
  if (!kKeepsFreedMemory) {
    EXPECT_LT(most_resident_, before + 20);
  }
  EXPECT_THAT(post("/swap", "Content-Type: application/json\r\nTransfer-Encoding: chunked\r\n", "1\r\nx\r\n0\r\n\r\n"),
              StartsWith("HTTP/1.1 411"));
  const std::string chunk = "4000\r\n" + std::string(0x4000, 'x') + "\r\n";
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(post("/swap", "Content-Type: application/json\r\nTransfer-Encoding: chunked\r\n", chunk, 1000), "");
  EXPECT_LT(std::chrono::steady_clock::now() - begin, kPatience) << "an endless body is cut off";
  EXPECT_EQ(swapped_, "");
}

// Browsers send no Origin with <img>, but mark the request as cross-site.
TEST_F(IdentifyServerTest, RefusesPagesOfOtherSites) {
  for (const char* path : {"/mosaic.jpg", "/mosaic.json"}) {
    for (const char* site : {"cross-site", "same-site"})
      EXPECT_THAT(request("GET", path, std::string("Sec-Fetch-Site: ") + site + "\r\n"), StartsWith("HTTP/1.1 403"))
          << path;
    const std::string own = request("GET", path, "Sec-Fetch-Site: same-origin\r\n");
    EXPECT_THAT(own, StartsWith("HTTP/1.1 200")) << path;
    EXPECT_THAT(own, HasSubstr("Cross-Origin-Resource-Policy: same-origin")) << path;
  }
  EXPECT_THAT(request("GET", "/", "Sec-Fetch-Site: cross-site\r\n"), Not(StartsWith("HTTP/1.1 403")))
      << "links from other sites are allowed";
  EXPECT_THAT(request("GET", "/mosaic.json", "Host: evil.example\r\n"), StartsWith("HTTP/1.1 400")) << "two hosts";
}

// A request can contain thousands of ranges, and a server would send each.
TEST_F(IdentifyServerTest, IgnoresRanges) {
  const std::string response = request("GET", "/mosaic.json", "Range: bytes=0-,0-,0-\r\n");
  EXPECT_THAT(response, AllOf(StartsWith("HTTP/1.1 200"), Not(HasSubstr("Content-Range"))));
}

TEST_F(IdentifyServerTest, SwapsAndClosesTheConnection) {
  const std::string body = R"({"a": 3, "b": 5})";
  const std::string response =
      post("/swap", "Content-Type: application/json\r\nContent-Length: " + std::to_string(body.size()) + "\r\n", body);
  EXPECT_THAT(response, AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("Connection: close")));
  EXPECT_EQ(swapped_, "3 and 5");
}

}  // namespace
}  // namespace lf::test
