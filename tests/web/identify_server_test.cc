// SPDX-License-Identifier: LGPL-2.1-or-later
#include "cameras/identify_server.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <atomic>
#include <string>
#include <thread>

namespace lf::test {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

// The server on this thread, asked by another one.
class IdentifyServerTest : public testing::Test {
 protected:
  // What comes back once this has been sent, "" if nothing does within seconds.
  std::string response_to(const std::string& bytes) {
    std::atomic<bool> done = false;
    std::string response;
    std::thread client([&] {
      response = ask(bytes);
      done = true;
      g_main_context_wakeup(nullptr);
    });
    while (!done) g_main_context_iteration(nullptr, TRUE);
    client.join();
    return response;
  }
  std::string post(const std::string& path, const std::string& headers, const std::string& body) {
    const std::string host = server_.url().substr(7, server_.url().size() - 8);
    return response_to("POST " + path + " HTTP/1.1\r\nHost: " + host + "\r\n" + headers + "\r\n" + body);
  }

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
  std::string ask(const std::string& bytes) const {
    const std::string url = server_.url();
    const int port = std::stoi(url.substr(url.rfind(':') + 1));
    const int socket = ::socket(AF_INET, SOCK_STREAM, 0);
    const timeval patience{.tv_sec = 10, .tv_usec = 0};
    setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    sockaddr_in to{
        .sin_family = AF_INET, .sin_port = htons(static_cast<uint16_t>(port)), .sin_addr = {}, .sin_zero = {}};
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    std::string response;
    if (connect(socket, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0 &&
        send(socket, bytes.data(), bytes.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(bytes.size())) {
      char buffer[2000];
      const ssize_t size = recv(socket, buffer, sizeof buffer, 0);
      if (size > 0) response.assign(buffer, static_cast<size_t>(size));
    }
    close(socket);
    return response;
  }
};

// A page of another site may send any body: it is refused before it is there.
TEST_F(IdentifyServerTest, LongBodiesAreNotWaitedFor) {
  EXPECT_THAT(post("/anything", "Content-Type: text/plain\r\nContent-Length: 300000000\r\n", "x"),
              StartsWith("HTTP/1.1 413"));
  EXPECT_THAT(post("/swap", "Content-Type: application/json\r\nTransfer-Encoding: chunked\r\n", ""),
              StartsWith("HTTP/1.1 411"));
}

TEST_F(IdentifyServerTest, SwapsAndClosesTheConnection) {
  const std::string body = R"({"a": 3, "b": 5})";
  const std::string response =
      post("/swap", "Content-Type: application/json\r\nContent-Length: " + std::to_string(body.size()) + "\r\n", body);
  EXPECT_THAT(response, StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(response, HasSubstr("Connection: close"));
  EXPECT_EQ(swapped_, "3 and 5");
}

}  // namespace
}  // namespace lf::test
