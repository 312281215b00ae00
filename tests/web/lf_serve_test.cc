// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-serve as anybody on the network meets it, without a browser.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <libsoup/soup.h>
#include <unistd.h>

#include <filesystem>
#include <map>

#include "web/offers.h"
#include "web/served.h"

namespace lf::test {
namespace {

using testing::HasSubstr;

using Headers = std::map<std::string, std::string>;

struct Response {
  guint status = 0;
  std::string body;
  Headers headers;
};

class LfServe : public testing::Test {
 protected:
  LfServe() : session_(soup_session_new()) { g_object_set(session_, "timeout", 60, nullptr); }
  ~LfServe() override { g_object_unref(session_); }

  Response ask(const Served& served, const std::string& method, const std::string& path, const Headers& headers = {},
               const std::string& body = "", const std::string& type = "application/sdp") {
    SoupMessage* message = soup_message_new(method.c_str(), (served.url() + path).c_str());
    if (!message) {
      ADD_FAILURE() << "lf-serve does not run";
      return {};
    }
    for (const auto& [name, value] : headers)
      soup_message_headers_replace(soup_message_get_request_headers(message), name.c_str(), value.c_str());
    if (method == "POST") {
      GBytes* bytes = g_bytes_new(body.data(), body.size());
      soup_message_set_request_body_from_bytes(message, type.c_str(), bytes);
      g_bytes_unref(bytes);
    }
    Response response;
    GError* error = nullptr;
    GBytes* bytes = soup_session_send_and_read(session_, message, nullptr, &error);
    EXPECT_EQ(error, nullptr) << error->message;
    if (bytes) {
      gsize size = 0;
      const char* data = static_cast<const char*>(g_bytes_get_data(bytes, &size));
      response.body.assign(data ? data : "", size);
      g_bytes_unref(bytes);
    }
    response.status = soup_message_get_status(message);
    soup_message_headers_foreach(
        soup_message_get_response_headers(message),
        [](const char* name, const char* value, gpointer data) { (*static_cast<Headers*>(data))[name] = value; },
        &response.headers);
    g_object_unref(message);
    return response;
  }
  Response offer(const Served& served, const std::string& text = browser_offer(), const Headers& headers = {},
                 const std::string& query = "") {
    return ask(served, "POST", "whep" + query, headers, text);
  }
  std::string metric(const Served& served, const std::string& name, const Headers& headers = {}) {
    const std::string text = "\n" + ask(served, "GET", "metrics", headers).body, line = "\nlightfield_" + name + " ";
    const size_t at = text.find(line);
    if (at == text.npos) return "none";
    return text.substr(at + line.size(), text.find('\n', at + 1) - at - line.size());
  }

  SoupSession* session_;
};

TEST_F(LfServe, ServesPageHealthAndMetrics) {
  Served served;
  ASSERT_NE(served.url(), "") << served.said();
  const Response page = ask(served, "GET", "");
  EXPECT_EQ(page.status, 200u);
  EXPECT_THAT(page.body, HasSubstr("<lightfield-viewer"));
  for (const char* file : {"lightfield-viewer.js", "src/connection.js", "src/controls.js", "src/headset.js",
                           "src/markup.js", "src/style.js", "src/view.js", "src/viewer.js"}) {
    const Response script = ask(served, "GET", file);
    EXPECT_EQ(script.status, 200u) << file;
    EXPECT_THAT(script.headers.at("Content-Type"), HasSubstr("text/javascript")) << file;
    EXPECT_EQ(script.body.find("http://"), std::string::npos) << file << " needs something from outside";
  }
  EXPECT_THAT(ask(served, "GET", "page.css").headers.at("Content-Type"), HasSubstr("text/css"));
  EXPECT_EQ(ask(served, "GET", "healthz").status, 200u);
  const Response array = ask(served, "GET", "array.json");
  EXPECT_EQ(array.status, 200u);
  EXPECT_THAT(array.body, HasSubstr("{\"name\":\"cam_00_00\",\"position\":[-0."));
  EXPECT_THAT(array.body, HasSubstr("\"faces\":[[0,1,"));
  EXPECT_EQ(ask(served, "GET", "../../etc/passwd").status, 404u);
  EXPECT_EQ(ask(served, "POST", "").status, 405u);
  EXPECT_EQ(metric(served, "viewers"), "0");
  EXPECT_EQ(served.stop(), 0) << served.said();
}

TEST_F(LfServe, FliesPathsThatItHas) {
  const TempDir dir;
  const auto views = [](const char* height) {
    return std::string(R"({"format": "lightfield-views", "version": 1, "views": [{"position": [0, 0, 0],
        "orientation": [1, 0, 0, 0], "width": 64, "height": )") +
           height + R"(, "fov_y": 30, "focus_distance": 2}]})";
  };
  dir.write("views.json", views("48"));
  Served served({"--path", "hall=" + (dir / "views.json")});
  ASSERT_NE(served.url(), "") << served.said();
  EXPECT_EQ(offer(served, browser_offer(), {}, "?path=hall").status, 201u) << served.said();
  EXPECT_EQ(offer(served, browser_offer(), {}, "?path=views.json").status, 404u);
  EXPECT_EQ(metric(served, "refused_total{reason=\"path\"}"), "1");
  dir.write("odd.json", views("47"));
  for (const char* wrong : {"hall", "=x", "hall=/nowhere.json"}) {
    Served none({"--path", wrong});
    EXPECT_EQ(none.stop(), 1) << wrong;
  }
  Served odd({"--path", "hall=" + (dir / "odd.json")});
  EXPECT_EQ(odd.stop(), 1);
  EXPECT_THAT(odd.said(), HasSubstr("even width and height"));
}

TEST_F(LfServe, AnswersAnOfferAndTakesLeave) {
  Served served;
  const Response answer = offer(served);
  ASSERT_EQ(answer.status, 201u) << answer.body << served.said();
  EXPECT_EQ(answer.headers.at("Content-Type"), "application/sdp");
  EXPECT_THAT(answer.body, HasSubstr("a=sendonly"));
  EXPECT_THAT(answer.body, HasSubstr("a=rtpmap:108 H264/90000"));
  EXPECT_THAT(answer.body, HasSubstr(" 127.0.0.1 "));
  EXPECT_THAT(answer.body, HasSubstr("a=ssrc:"));
  EXPECT_THAT(answer.body, testing::Not(HasSubstr("ssrc-group:FID 0"))) << "browsers show black";
  const std::string location = answer.headers.at("Location");
  EXPECT_EQ(location.size(), sizeof("/whep/") - 1 + 32) << location;
  EXPECT_EQ(metric(served, "viewers"), "1");
  EXPECT_EQ(ask(served, "PATCH", location.substr(1)).status, 405u);
  EXPECT_EQ(ask(served, "DELETE", "whep/0123456789abcdef0123456789abcdef").status, 404u);
  EXPECT_EQ(ask(served, "DELETE", location.substr(1)).status, 200u);
  EXPECT_EQ(ask(served, "DELETE", location.substr(1)).status, 404u);
  EXPECT_EQ(metric(served, "viewers"), "0");
}

TEST_F(LfServe, RefusesBadOffersWithTheirStatus) {
  Served served({"--connects", "1000"});
  const std::string good = browser_offer();
  for (const std::string& bad :
       {std::string(), std::string("hello"), std::string("v=0\r\n"), with(good, "a=fingerprint", "a=finger"),
        with(good, "a=ice-ufrag:Yzk8\r\n", ""), with(good, "m=video", "m=audio"), good.substr(0, 300)})
    EXPECT_EQ(offer(served, bad).status, 400u) << bad;
  EXPECT_EQ(offer(served, good, {}, "?width=x").status, 400u);
  EXPECT_EQ(offer(served, good, {}, "?eye-distance=near").status, 400u);
  EXPECT_EQ(offer(served, std::string(100000, 'v')).status, 413u);
  EXPECT_EQ(ask(served, "POST", "whep", {}, good, "text/plain").status, 415u);
  EXPECT_EQ(ask(served, "GET", "whep").status, 405u);
  EXPECT_EQ(metric(served, "viewers_total"), "0");
  EXPECT_EQ(metric(served, "refused_total{reason=\"offer\"}"), "9");
  EXPECT_EQ(metric(served, "refused_total{reason=\"body\"}"), "1");
  EXPECT_EQ(served.stop(), 0);
  EXPECT_THAT(served.said(), HasSubstr("127.0.0.1: 413, the body is too long"));
}

TEST_F(LfServe, AsksForTheToken) {
  const TempDir dir;
  dir.write("token", "open sesame\n");
  Served served({"--token-file", dir / "token"});
  const Headers right = {{"Authorization", "Bearer open sesame"}};
  for (const Headers& wrong : {Headers{}, Headers{{"Authorization", "Bearer open"}}}) {
    const Response response = offer(served, browser_offer(), wrong);
    EXPECT_EQ(response.status, 401u);
    EXPECT_EQ(response.headers.at("WWW-Authenticate"), "Bearer");
    EXPECT_EQ(ask(served, "GET", "metrics", wrong).status, 401u);
    EXPECT_EQ(ask(served, "GET", "array.json", wrong).status, 401u);
    EXPECT_EQ(ask(served, "DELETE", "whep/0123456789abcdef0123456789abcdef", wrong).status, 401u);
  }
  EXPECT_EQ(offer(served, browser_offer(), right).status, 201u);
  EXPECT_EQ(metric(served, "refused_total{reason=\"token\"}", right), "8");
}

TEST_F(LfServe, AsksForTheOrigin) {
  Served served({"--origin", "https://example.org"});
  EXPECT_EQ(offer(served, browser_offer(), {{"Origin", "https://evil.org"}}).status, 403u);
  EXPECT_EQ(offer(served, browser_offer(), {{"Host", "evil.org"}, {"Origin", "http://evil.org"}}).status, 403u);
  const Response asked = ask(served, "OPTIONS", "whep", {{"Origin", "https://example.org"}});
  EXPECT_EQ(asked.status, 204u);
  EXPECT_EQ(asked.headers.at("Access-Control-Allow-Origin"), "https://example.org");
  EXPECT_THAT(asked.headers.at("Access-Control-Allow-Headers"), HasSubstr("Authorization"));
  const Response answer = offer(served, browser_offer(), {{"Origin", "https://example.org"}});
  EXPECT_EQ(answer.status, 201u);
  EXPECT_THAT(answer.headers.at("Access-Control-Expose-Headers"), HasSubstr("Location"));
}

TEST_F(LfServe, LimitsViewersAndForgetsTheSilent) {
  Served served({"--viewers", "2"});
  ASSERT_EQ(offer(served).status, 201u);
  EXPECT_EQ(offer(served, browser_offer(), {}, "?eye-distance=0.06").status, 503u) << "two views";
  ASSERT_EQ(offer(served).status, 201u);
  const Response full = offer(served);
  EXPECT_EQ(full.status, 503u);
  EXPECT_TRUE(full.headers.contains("Retry-After"));
  // They never connect. The margin is for the machine.
  for (int i = 0; i < 300 && metric(served, "viewers") != "0"; i++) g_usleep(100000);
  EXPECT_EQ(metric(served, "viewers"), "0");
  EXPECT_EQ(offer(served).status, 201u);
  EXPECT_EQ(served.stop(), 0);
  EXPECT_THAT(served.said(), HasSubstr("closes: it does not connect"));
}

TEST_F(LfServe, ClosesConnectionsOfClientsThatHaveGone) {
  Served served;
  const auto open_files = [&served] {
    const std::filesystem::directory_iterator files("/proc/" + served.pid() + "/fd");
    return std::distance(begin(files), end(files));
  };
  const auto before = open_files();
  for (int i = 0; i < 20; i++) {
    soup_session_abort(session_);
    EXPECT_EQ(ask(served, "GET", i % 2 ? "healthz" : "").status, 200u);
    EXPECT_EQ(offer(served, "v=0").status, 400u);
  }
  soup_session_abort(session_);
  // Cameras open and close files of their own; connections that stay would be 40.
  constexpr int kOthers = 15;
  for (int i = 0; i < 100 && open_files() > before + kOthers; i++) g_usleep(100000);
  EXPECT_LE(open_files(), before + kOthers);
}

TEST_F(LfServe, LimitsConnectsOfAnAddress) {
  Served served({"--connects", "0.01"});
  int refused = 0;
  Response last;
  for (int i = 0; i < 60; i++) {
    last = offer(served, "v=0");
    refused += last.status == 429;
  }
  EXPECT_EQ(refused, 20) << "after a burst of 40";
  EXPECT_TRUE(last.headers.contains("Retry-After"));
}

TEST_F(LfServe, ListensToOthersOnlyWhenTold) {
  Served served({"--listen", "0.0.0.0"});
  EXPECT_EQ(served.url(), "");
  EXPECT_EQ(served.stop(), 1);
  EXPECT_THAT(served.said(), HasSubstr("--tls-certificate"));
  Served insecure({"--listen", "0.0.0.0", "--insecure"});
  EXPECT_NE(insecure.url(), "") << insecure.said();
  EXPECT_EQ(insecure.stop(), 0);
}

}  // namespace
}  // namespace lf::test
