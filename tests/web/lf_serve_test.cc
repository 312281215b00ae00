// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-serve from the network, without a browser.

#include <regex>

#include <sys/socket.h>
#include <sys/un.h>

#include "base/file.h"
#include "web/offers.h"
#include "web/served.h"

namespace lf::test {
namespace {

class LfServe : public testing::Test {
 protected:
  LfServe() : session_(soup_session_new()) { g_object_set(session_, "timeout", 60, nullptr); }
  ~LfServe() override { g_object_unref(session_); }

  Response ask(const Served& served, const std::string& method, const std::string& path, const Headers& headers = {},
               const std::string& body = "", const std::string& type = "application/sdp") {
    return fetch(session_, method, served.url() + path, headers, body, type);
  }
  Response offer(const Served& served, const std::string& text = browser_offer(), const Headers& headers = {},
                 const std::string& query = "") {
    return ask(served, "POST", "whep" + query, headers, text);
  }
  std::string metric(const Served& served, const std::string& name, const Headers& headers = {}) {
    return metric_in(ask(served, "GET", "metrics", headers).body, name);
  }

  SoupSession* session_;
};

const Headers kToken = {{"Authorization", "Bearer open sesame"}};
struct TokenFile {
  const TempDir dir;
  const std::string path = dir.write_secret("token", "open sesame\n");
};

TEST_F(LfServe, ServesPageHealthAndMetrics) {
  Served served;
  ASSERT_NE(served.url(), "") << served.said();
  const Response page = ask(served, "GET", "");
  EXPECT_EQ(page.status, 200u);
  EXPECT_THAT(page.body, HasSubstr("<lightfield-viewer"));
  for (const char* file : {"lightfield-viewer.js", "src/connection.js", "src/controls.js", "src/headset.js",
                           "src/markup.js", "src/view.js", "src/viewer.js"}) {
    const Response script = ask(served, "GET", file);
    EXPECT_EQ(script.status, 200u) << file;
    EXPECT_THAT(script.headers.at("Content-Type"), HasSubstr("text/javascript")) << file;
    const std::string body = std::regex_replace(script.body, std::regex("'http://www.w3.org/2000/svg'"), "");
    EXPECT_EQ(body.find("http://"), std::string::npos) << file << " needs something from outside";
  }
  EXPECT_THAT(ask(served, "GET", "page.css").headers.at("Content-Type"), HasSubstr("text/css"));
  EXPECT_EQ(ask(served, "GET", "healthz").status, 200u);
  const Response array = ask(served, "GET", "array.json");
  EXPECT_EQ(array.status, 200u);
  EXPECT_THAT(array.body, AllOf(HasSubstr("{\"name\":\"cam_00_00\",\"position\":[-0."), HasSubstr("\"faces\":[[0,1,")));
  EXPECT_EQ(ask(served, "GET", "../../etc/passwd").status, 404u);
  EXPECT_EQ(ask(served, "POST", "").status, 405u);
  EXPECT_EQ(metric(served, "viewers"), "0");
  EXPECT_EQ(served.stop(), 0) << served.said();
}

TEST_F(LfServe, PlaysPaths) {
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
  EXPECT_THAT(odd.said(), HasSubstr("must be even"));
}

// systemd (Type=notify) is a datagram socket.
TEST_F(LfServe, NotifiesSystemd) {
  const TempDir dir;
  const std::string path = dir / "notify";
  sockaddr_un address = {.sun_family = AF_UNIX, .sun_path = {}};
  ASSERT_LT(path.size(), sizeof address.sun_path);
  path.copy(address.sun_path, path.size());
  const int socket = ::socket(AF_UNIX, SOCK_DGRAM, 0);
  ASSERT_EQ(bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  const timeval patience = {.tv_sec = 60, .tv_usec = 0};
  setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  const auto receives = [socket](const std::string& what) {
    char text[256];
    for (ssize_t size; (size = recv(socket, text, sizeof text, 0)) > 0;)
      if (contains(std::string(text, static_cast<size_t>(size)), what)) return true;
    return false;
  };
  g_setenv("NOTIFY_SOCKET", path.c_str(), TRUE);
  g_setenv("WATCHDOG_USEC", "200000", TRUE);
  Served served;
  g_unsetenv("NOTIFY_SOCKET");
  g_unsetenv("WATCHDOG_USEC");
  for (const char* state : {"READY=1", "STATUS=serving", "WATCHDOG=1", "WATCHDOG=1"}) EXPECT_TRUE(receives(state));
  EXPECT_EQ(served.stop(), 0);
  EXPECT_TRUE(receives("STOPPING=1"));
  close(socket);
}

// A proxy finds the replica of a session or of a ticket by the name at its beginning.
TEST_F(LfServe, NamesOfSessionsAndTicketsBeginWithTheReplica) {
  Served served({"--replica", "r1", "--viewers", "1"});
  EXPECT_EQ(ask(served, "GET", "readyz").status, 200u);
  const Response admitted = offer(served), full = offer(served);
  ASSERT_EQ(admitted.status, 201u) << admitted.body;
  EXPECT_THAT(admitted.headers.at("Location"), testing::StartsWith("/whep/r1-"));
  EXPECT_THAT(full.body, HasSubstr("\"ticket\":\"r1-"));
  EXPECT_EQ(ask(served, "DELETE", admitted.headers.at("Location").substr(1)).status, 200u);
  for (const char* wrong : {"r-1", "r 1", "012345678901234567890123456789012"}) {
    Served none({"--replica", wrong});
    EXPECT_EQ(none.stop(), 1) << wrong;
  }
}

TEST_F(LfServe, AnswersAnOfferAndEndsTheSession) {
  Served served;
  const Response answer = offer(served);
  ASSERT_EQ(answer.status, 201u) << answer.body << served.said();
  EXPECT_EQ(answer.headers.at("Content-Type"), "application/sdp");
  EXPECT_THAT(answer.body, AllOf(HasSubstr("a=sendonly"), HasSubstr("a=rtpmap:108 H264/90000")));
  EXPECT_THAT(answer.body, HasSubstr(" 127.0.0.1 "));
  EXPECT_THAT(answer.body, HasSubstr("a=ssrc:"));
  EXPECT_THAT(answer.body, Not(HasSubstr("ssrc-group:FID 0"))) << "browsers show black";
  const std::string location = answer.headers.at("Location");
  EXPECT_EQ(location.size(), sizeof("/whep/") - 1 + 32) << location;
  EXPECT_EQ(metric(served, "viewers"), "1");
  EXPECT_EQ(ask(served, "PATCH", location.substr(1)).status, 405u);
  EXPECT_EQ(ask(served, "DELETE", "whep/0123456789abcdef0123456789abcdef").status, 404u);
  EXPECT_EQ(ask(served, "HEAD", location.substr(1)).status, 204u);
  EXPECT_EQ(ask(served, "DELETE", location.substr(1)).status, 200u);
  EXPECT_EQ(ask(served, "DELETE", location.substr(1)).status, 404u);
  EXPECT_EQ(ask(served, "GET", location.substr(1)).status, 404u);
  EXPECT_EQ(metric(served, "viewers"), "0");
}

TEST_F(LfServe, RefusesBadOffers) {
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
  EXPECT_THAT(served.said(), mentions("127.0.0.1", "413", "body"));
}

TEST_F(LfServe, RequiresTheToken) {
  const TokenFile token;
  Served served({"--token-file", token.path});
  for (const Headers& wrong : {Headers{}, Headers{{"Authorization", "Bearer open"}}}) {
    const Response response = offer(served, browser_offer(), wrong);
    EXPECT_EQ(response.status, 401u);
    EXPECT_EQ(response.headers.at("WWW-Authenticate"), "Bearer");
    EXPECT_EQ(ask(served, "GET", "metrics", wrong).status, 401u);
    EXPECT_EQ(ask(served, "GET", "array.json", wrong).status, 401u);
    EXPECT_EQ(ask(served, "DELETE", "whep/0123456789abcdef0123456789abcdef", wrong).status, 401u);
  }
  EXPECT_EQ(offer(served, browser_offer(), kToken).status, 201u);
  EXPECT_EQ(metric(served, "refused_total{reason=\"token\"}", kToken), "8");
}

TEST_F(LfServe, ChecksTheOrigin) {
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

// The clients never connect. Margins allow for slow machines.
TEST_F(LfServe, QueuesViewersWithoutASeat) {
  Served served({"--viewers", "2", "--address-views", "1", "--proxy", "127.0.0.1", "--connects", "1000"});
  const auto from = [&](const char* address, const std::string& query = "") {
    return offer(served, browser_offer(), {{"X-Forwarded-For", address}}, query);
  };
  ASSERT_EQ(from("192.0.2.1").status, 201u);
  EXPECT_EQ(from("192.0.2.2", "?eye-distance=0.06").status, 429u) << "two views";
  const Response again = from("192.0.2.1");
  if (again.status != 201u) {
    EXPECT_EQ(again.status, 429u);
    EXPECT_THAT(again.body, AllOf(HasSubstr("\"reason\":\"address\""), HasSubstr("\"seats\":1")));
  }
  ASSERT_EQ(from("192.0.2.2").status, 201u);
  const Response full = from("192.0.2.3");
  if (full.status == 503u) {
    EXPECT_EQ(full.headers.at("Content-Type"), "application/problem+json");
    EXPECT_EQ(full.headers.at("Retry-After"), "1");
    EXPECT_THAT(full.body, HasSubstr("\"place\":1"));
    const std::string key = "\"ticket\":\"";
    const std::string ticket = full.body.substr(full.body.find(key) + key.size(), 32);
    EXPECT_TRUE(becomes([&] {
      g_usleep(200000);
      return from("192.0.2.3", "?ticket=" + ticket).status == 201u;
    })) << "an unused seat is released";
  }
  EXPECT_TRUE(becomes([&] { return metric(served, "viewers") == "0"; }));
  EXPECT_EQ(served.stop(), 0);
  EXPECT_THAT(served.said(), mentions("closes", "connect"));
}

TEST_F(LfServe, ForwardedAddressesNeedATrustedProxy) {
  Served served({"--connects", "1000"});
  const auto from = [&](const std::string& address) {
    return offer(served, browser_offer(), {{"X-Forwarded-For", address}, {"X-Forwarded-Prefix", "/there"}});
  };
  const Response first = from("192.0.2.1");
  EXPECT_EQ(first.status, 201u);
  EXPECT_TRUE(first.headers.at("Location").starts_with("/whep/"));
  EXPECT_EQ(from("192.0.2.2").status, 201u);
  EXPECT_EQ(from("192.0.2.3").status, 429u);
  Served proxied({"--proxy", "127.0.0.1", "--host", "example.org"});
  const Response answer =
      offer(proxied, browser_offer(), {{"X-Forwarded-Prefix", "/light/field/"}, {"Origin", "https://example.org"}});
  EXPECT_EQ(answer.status, 201u) << "the proxy's own name, despite the forwarded host";
  const std::string location = answer.headers.at("Location");
  ASSERT_TRUE(location.starts_with("/light/field/whep/")) << location;
  EXPECT_EQ(ask(proxied, "DELETE", location.substr(sizeof "/light/field")).status, 200u);
}

TEST_F(LfServe, ChecksTheHost) {
  Served served({"--host", "cameras.example"});
  for (const char* host : {"cameras.example", "localhost:1", "127.0.0.1"})
    EXPECT_EQ(ask(served, "GET", "array.json", {{"Host", host}}).status, 200u) << host;
  for (const char* path : {"", "array.json", "metrics", "whep"}) {
    const Response refused = ask(served, "GET", path, {{"Host", "evil.org"}});
    EXPECT_EQ(refused.status, 403u) << path;
    EXPECT_THAT(refused.body, HasSubstr("\"reason\":\"host\"")) << path;
  }
  EXPECT_EQ(ask(served, "GET", "healthz", {{"Host", "evil.org"}}).status, 200u) << "for monitoring";
}

TEST_F(LfServe, SendsSecurityHeaders) {
  Served served({"--origin", "https://example.org"});
  for (const char* path : {"", "array.json", "nowhere", "whep"}) {
    const Response response = ask(served, "GET", path);
    EXPECT_EQ(response.headers.at("X-Content-Type-Options"), "nosniff") << path;
    EXPECT_EQ(response.headers.at("Referrer-Policy"), "no-referrer") << path;
  }
  const std::string policy = ask(served, "GET", "").headers.at("Content-Security-Policy");
  EXPECT_THAT(policy, AllOf(HasSubstr("default-src 'self'"), HasSubstr("frame-ancestors 'self' https://example.org")));
}

TEST_F(LfServe, LimitsWrongTokens) {
  const TokenFile token;
  Served served({"--token-file", token.path});
  int wrong = 0, refused = 0;
  for (int i = 0; i < 40; i++) {
    const guint status = ask(served, "GET", "array.json", {{"Authorization", "Bearer guess"}}).status;
    wrong += status == 401;
    refused += status == 429;
  }
  EXPECT_GE(wrong, 10);
  EXPECT_GE(refused, 20);
  EXPECT_EQ(ask(served, "GET", "array.json").status, 401u) << "asks clients without a token";
  EXPECT_EQ(ask(served, "GET", "array.json", kToken).status, 200u) << "accepts the right token";
  EXPECT_EQ(ask(served, "GET", "").status, 200u);
}

TEST_F(LfServe, SendsIceServersOnlyToAuthorisedClients) {
  const TempDir dir;
  dir.write_secret("token", "open sesame\n");
  dir.write_secret("turn", "user password\n");
  Served served({"--token-file", dir / "token", "--ice-server", "stun:127.0.0.1:9", "--ice-server", "turn:127.0.0.1:9",
                 "--ice-credentials", dir / "turn"});
  const Headers wrong = {{"Authorization", "Bearer open"}};
  EXPECT_FALSE(ask(served, "OPTIONS", "whep").headers.contains("Link"));
  EXPECT_EQ(ask(served, "OPTIONS", "whep", wrong).status, 401u);
  const std::string link = ask(served, "OPTIONS", "whep", kToken).headers.at("Link");
  EXPECT_EQ(link,
            "<stun:127.0.0.1:9>; rel=\"ice-server\", <turn:127.0.0.1:9>; rel=\"ice-server\"; username=\"user\"; "
            "credential=\"password\"; credential-type=\"password\"");
  const Response answer = offer(served, browser_offer(), kToken);
  EXPECT_EQ(answer.status, 201u);
  EXPECT_EQ(answer.headers.at("Link"), link);
  EXPECT_EQ(served.stop(), 0);
  EXPECT_THAT(served.said(), Not(HasSubstr("password")));
  Served none({"--ice-server", "turn:127.0.0.1:9"});
  EXPECT_EQ(none.stop(), 1);
  EXPECT_THAT(none.said(), HasSubstr("--ice-credentials"));
}

TEST_F(LfServe, ServesThePageWhileTheSceneIsFilmed) {
  const TempDir dir;
  Served served(Served::Demo{dir});
  ASSERT_NE(served.url(), "") << served.said();
  EXPECT_EQ(ask(served, "GET", "").status, 200u);
  EXPECT_EQ(ask(served, "GET", "healthz").status, 200u);
  const Response response = offer(served);
  EXPECT_EQ(response.status, 503u);
  EXPECT_EQ(response.headers.at("Retry-After"), "1");
  EXPECT_THAT(response.body, AllOf(HasSubstr("\"reason\":\"filming\""), HasSubstr("\"progress\":0")));
  EXPECT_EQ(ask(served, "GET", "array.json").status, 503u);
  EXPECT_EQ(ask(served, "GET", "readyz").status, 503u) << "it serves no views yet";
  EXPECT_EQ(served.stop(), 0);
}

// A script beside the program films a small scene, and the rest of the film only on command.
TEST_F(LfServe, ShowsTheFirstFrameOfTheDemoUntilItsFilmIsComplete) {
  const TempDir dir;
  const std::string program = dir / "lf-serve", scene = dir / "gst-lightfield/scene-" LF_VERSION;
  std::filesystem::copy_file(LF_TOOLS_DIR "/lf-serve", program);
  dir.write("lf-scene",
            "#!/bin/sh\nframes=${10}\nif [ $frames -gt 1 ]; then until [ -e '" + (dir / "go") +
                "' ]; do sleep 0.1; done; frames=3; fi\nexec " LF_TOOLS_DIR
                "/lf-scene --out \"$2\" --grid 2x2 --width 64 --height 48 --frames $frames --format ${12}\n");
  std::filesystem::permissions(dir / "lf-scene", std::filesystem::perms::owner_all);
  dir.write("applications/browser.desktop", "[Desktop Entry]\nType=Application\nName=browser\nExec=sh -c 'echo %u >\"" +
                                                (dir / "opened") + "\"'\nMimeType=x-scheme-handler/http;\n");
  dir.write("mimeapps.list", "[Default Applications]\nx-scheme-handler/http=browser.desktop\n");
  {
    Served served(Served::Demo{.home = dir, .program = program, .options = {"--demo", "--open"}});
    ASSERT_TRUE(served.says({"serving", scene + "/first/rig.json"})) << served.said();
    EXPECT_TRUE(becomes([&] { return std::filesystem::exists(dir / "opened"); }));
    EXPECT_EQ(ask(served, "GET", "readyz").status, 200u);
    EXPECT_EQ(offer(served).status, 201u);
    EXPECT_FALSE(std::filesystem::exists(scene + "/rig.json"));
    dir.write("go", "");
    EXPECT_TRUE(served.says({"the rig is", scene + "/rig.json", "viewers: 1"})) << served.said();
    EXPECT_EQ(ask(served, "GET", "readyz").status, 200u);
    EXPECT_THAT(read_file(dir / "opened"), HasSubstr(served.url()));
    EXPECT_EQ(served.stop(), 0) << served.said();
  }
  Served again(Served::Demo{.home = dir, .program = program, .beginning = "serving"});
  EXPECT_THAT(again.said(), HasSubstr(scene + "/rig.json"));
  EXPECT_FALSE(std::filesystem::exists(scene + "/first"));
}

TEST_F(LfServe, SilentConnectionsDoNotBlockOthers) {
  Served served;
  const auto open_sockets = [&served] {
    int sockets = 0;
    for (const auto& file : std::filesystem::directory_iterator("/proc/" + served.pid() + "/fd")) {
      std::error_code gone;
      sockets += std::filesystem::read_symlink(file, gone).string().starts_with("socket:");
    }
    return sockets;
  };
  const int before = open_sockets();
  std::list<Client> silent;
  for (int i = 0; i < 400; i++) silent.emplace_back(served).send(i % 2 ? "GET / HTTP/1.1\r\n" : "");
  EXPECT_EQ(ask(served, "GET", "healthz").status, 200u);
  EXPECT_EQ(offer(served).status, 201u);
  constexpr int kMost = 256, kOthers = 20;  // threads of the viewer and its pipeline
  EXPECT_LE(open_sockets(), before + kMost + kOthers);
  EXPECT_TRUE(becomes([&] { return open_sockets() <= before + kOthers; })) << "a request takes 10 s at most";
}

TEST_F(LfServe, ClosesAbandonedConnections) {
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
  // Cameras open and close files as well; leaked connections would be 40.
  constexpr int kOthers = 15;
  EXPECT_TRUE(becomes([&] { return open_files() <= before + kOthers; })) << open_files();
}

// A certificate for 127.0.0.1 from a private authority.
class LfServeTls : public LfServe {
 protected:
  LfServeTls() { make_certificate(); }
  ~LfServeTls() override { trust(""); }

  void make_certificate(bool with_key = true) {
    const std::string key = with_key ? dir_ / "key.pem" : dir_ / "other.pem",
                      command =
                          "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 2 -subj "
                          "/CN=lf-serve -addext "
                          "subjectAltName=IP:127.0.0.1 -keyout '" +
                          key + "' -out '" + dir_ / "certificate.pem" + "' 2>/dev/null";
    ASSERT_EQ(std::system(command.c_str()), 0) << "is openssl installed?";
    std::filesystem::permissions(key, std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  }
  // New connections of ask() trust only the certificates in this file.
  void trust(const std::string& file) {
    g_autoptr(GTlsDatabase) database = file.empty() ? nullptr : g_tls_file_database_new(file.c_str(), nullptr);
    soup_session_abort(session_);
    soup_session_set_tls_database(session_, database);
  }
  std::vector<std::string> options() const {
    return {"--tls-certificate", dir_ / "certificate.pem", "--tls-key", dir_ / "key.pem"};
  }

  const TempDir dir_;
};

TEST_F(LfServeTls, AnswersOverHttps) {
  Served served(options());
  ASSERT_TRUE(served.url().starts_with("https://")) << served.said();
  trust(dir_ / "certificate.pem");
  for (int i = 0; i < 3; i++) EXPECT_EQ(ask(served, "GET", "healthz").status, 200u);
  EXPECT_THAT(ask(served, "GET", "").body, HasSubstr("<lightfield-viewer"));
  EXPECT_EQ(offer(served).status, 201u);
  EXPECT_EQ(served.stop(), 0) << served.said();
}

TEST_F(LfServeTls, ReloadsTheCertificate) {
  Served served(options());
  const std::string first = dir_ / "first.pem";
  std::filesystem::copy_file(dir_ / "certificate.pem", first);
  trust(first);
  EXPECT_EQ(ask(served, "GET", "healthz").status, 200u);
  make_certificate(false);
  EXPECT_TRUE(served.says({"old one"})) << served.said();
  EXPECT_THAT(served.said(), mentions("private key", "certificate"));
  soup_session_abort(session_);
  EXPECT_EQ(ask(served, "GET", "healthz").status, 200u) << "with the matching certificate";
  std::filesystem::rename(dir_ / "other.pem", dir_ / "key.pem");
  EXPECT_TRUE(served.says({"new connections", "new certificate"})) << served.said();
  trust(dir_ / "certificate.pem");
  EXPECT_EQ(ask(served, "GET", "healthz").status, 200u);
}

// chmod changes neither size nor modification time of a file.
TEST_F(LfServeTls, NoticesARepairedModeOfTheKey) {
  using std::filesystem::perm_options, std::filesystem::perms;
  Served served(options());
  std::filesystem::permissions(dir_ / "key.pem", perms::others_read, perm_options::add);
  EXPECT_TRUE(served.says({"old one"})) << served.said();
  EXPECT_THAT(served.said(), HasSubstr("chmod 600 " + dir_ / "key.pem"));
  std::filesystem::permissions(dir_ / "key.pem", perms::others_read, perm_options::remove);
  EXPECT_TRUE(served.says({"new connections", "new certificate"})) << served.said();
  trust(dir_ / "certificate.pem");
  EXPECT_EQ(ask(served, "GET", "healthz").status, 200u);
}

TEST_F(LfServeTls, RefusesUnusableFiles) {
  const auto said = [](const std::vector<std::string>& options) {
    Served served(options);
    EXPECT_EQ(served.stop(), 1);
    return served.said();
  };
  EXPECT_THAT(said({"--tls-key", dir_ / "key.pem"}), HasSubstr("together"));
  EXPECT_THAT(said({"--tls-certificate", dir_ / "key.pem", "--tls-key", dir_ / "key.pem"}),
              HasSubstr("no certificate"));
  dir_.write_secret("empty.pem", "");
  EXPECT_THAT(said({"--tls-certificate", dir_ / "certificate.pem", "--tls-key", dir_ / "empty.pem"}),
              HasSubstr("no private key"));
  std::filesystem::permissions(dir_ / "key.pem", std::filesystem::perms::others_read,
                               std::filesystem::perm_options::add);
  EXPECT_THAT(said(options()), HasSubstr("chmod 600 " + dir_ / "key.pem"));
}

// GLib performs each handshake in one of a few threads. Half of the clients start a handshake and stall.
TEST_F(LfServeTls, StalledHandshakesDoNotBlockOthers) {
  Served served(options());
  trust(dir_ / "certificate.pem");
  std::list<Client> stalled;
  for (int i = 0; i < 300; i++)
    stalled.emplace_back(served, "127.0.1." + std::to_string(1 + i % 250)).send(i % 2 ? "\x16\x03\x01\x02" : "");
  EXPECT_EQ(ask(served, "GET", "healthz").status, 200u);
  for (Client& client : stalled) EXPECT_EQ(client.read(), "") << "all are closed";
  EXPECT_EQ(ask(served, "GET", "healthz").status, 200u);
  EXPECT_EQ(served.stop(), 0) << served.said();
}

// The system's trusted certificates, about 300 kB, are not loaded, because no client has a certificate.
TEST_F(LfServeTls, HandshakesReadNoFiles) {
  Served served(options());
  trust(dir_ / "certificate.pem");
  ASSERT_EQ(ask(served, "GET", "healthz").status, 200u);
  const auto bytes_read = [&served] {
    std::ifstream io("/proc/" + served.pid() + "/io");
    std::string name;
    uint64_t bytes = 0;
    io >> name >> bytes;
    EXPECT_EQ(name, "rchar:");
    return bytes;
  };
  constexpr int kClients = 40;
  const uint64_t before = bytes_read();
  std::list<Client> clients;
  for (int i = 0; i < kClients; i++)
    clients.emplace_back(served, "127.0.1." + std::to_string(1 + i)).send("\x16\x03\x01\x02");
  for (Client& client : clients) EXPECT_EQ(client.read(), "");
  EXPECT_LT(bytes_read() - before, kClients * 50'000u);
}

// A request can contain thousands of ranges, and libsoup would send the body for each range.
TEST_F(LfServe, IgnoresRanges) {
  Served served;
  for (const char* path : {"mosaic.jpg", "lightfield-viewer.js", ""}) {
    const Response response = ask(served, "GET", path, {{"Range", "bytes=0-,0-,0-"}});
    EXPECT_EQ(response.status, 200u) << path;
    EXPECT_EQ(response.headers.count("Content-Range"), 0u) << path;
  }
}

// A customer with IPv6 has many networks; the test uses as many loopback addresses.
TEST_F(LfServe, IdleConnectionsDoNotDisplaceOthers) {
  Served served;
  std::list<Client> idle;
  const auto flood = [&](int count) {
    for (size_t n = idle.size(); count > 0; count--, n++)
      idle.emplace_back(served, "127.1." + std::to_string(n / 250) + "." + std::to_string(1 + n % 250));
  };
  flood(260);
  g_usleep(1100000);
  for (const char* honest : {"127.0.0.1", "127.99.9.9"}) {
    Client slow(served, honest);
    slow.send("GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n");
    flood(100);
    slow.send("\r\n");
    EXPECT_THAT(slow.read(), StartsWith("HTTP/1.1 200")) << honest;
  }
}

// Browsers send no Origin with <img>.
TEST_F(LfServe, RefusesPagesOfOtherSites) {
  Served served({"--origin", "https://Example.org/"});
  const Headers embedded = {
      {"Sec-Fetch-Site", "cross-site"}, {"Sec-Fetch-Mode", "no-cors"}, {"Sec-Fetch-Dest", "image"}};
  for (const char* path : {"mosaic.jpg", "mosaic.json", "array.json", "monitor.json", "metrics", "whep"}) {
    const Response refused = ask(served, "GET", path, embedded);
    EXPECT_EQ(refused.status, 403u) << path;
    EXPECT_THAT(refused.body, HasSubstr("\"reason\":\"origin\"")) << path;
    EXPECT_EQ(refused.headers.at("Cross-Origin-Resource-Policy"), "same-origin") << path;
  }
  EXPECT_EQ(ask(served, "GET", "mosaic.jpg", {{"Sec-Fetch-Site", "same-origin"}}).status, 200u);
  EXPECT_EQ(ask(served, "GET", "mosaic.jpg", {{"Sec-Fetch-Site", "none"}}).status, 200u);
  EXPECT_EQ(
      ask(served, "GET", "mosaic.jpg", {{"Sec-Fetch-Site", "cross-site"}, {"Origin", "https://example.org"}}).status,
      200u);
  EXPECT_EQ(ask(served, "GET", "mosaic.jpg").headers.at("Cross-Origin-Resource-Policy"), "same-origin");
  const Response script = ask(served, "GET", "lightfield-viewer.js", embedded);
  EXPECT_EQ(script.status, 200u) << "other sites' pages may use the element";
  EXPECT_EQ(script.headers.at("Cross-Origin-Resource-Policy"), "cross-origin");
}

// Programs disagree about which of two headers counts.
TEST_F(LfServe, RefusesDuplicateHeaders) {
  Served served;
  const auto answer = [&](const std::string& headers) {
    Client client(served);
    client.send("GET /array.json HTTP/1.1\r\n" + headers + "\r\n");
    return client.read();
  };
  EXPECT_THAT(answer("Host: 127.0.0.1\r\n"), StartsWith("HTTP/1.1 200"));
  for (const char* twice : {"Host: evil.example\r\nHost: 127.0.0.1\r\n", "Host: 127.0.0.1\r\nhost: evil.example\r\n",
                            "Host: 127.0.0.1\r\nOrigin: http://127.0.0.1\r\nOrigin: http://evil.example\r\n",
                            "Host: 127.0.0.1\r\nSec-Fetch-Site: cross-site\r\nSec-Fetch-Site: none\r\n"}) {
    const std::string refused = answer(twice);
    EXPECT_THAT(refused, StartsWith("HTTP/1.1 400")) << twice;
    EXPECT_EQ(refused.find("\"cameras\""), refused.npos) << twice;
  }
}

TEST_F(LfServe, RefusesReadableSecrets) {
  const TempDir dir;
  dir.write("open", "open sesame and a lot more\n");  // world-readable due to the umask
  std::filesystem::permissions(dir / "open", std::filesystem::perms(0644));
  for (const std::vector<std::string>& options :
       {std::vector<std::string>{"--token-file", dir / "open"},
        {"--ice-server", "turn:127.0.0.1:9", "--ice-credentials", dir / "open"},
        {"--nodes", "127.0.0.1:6000:6100", "--key-file", dir / "open"}}) {
    Served served(options);
    EXPECT_EQ(served.stop(), 1) << options[0];
    EXPECT_THAT(served.said(), HasSubstr("chmod 600 " + dir / "open")) << options[0];
  }
}

TEST_F(LfServe, RefusesUselessOptions) {
  const std::pair<std::vector<std::string>, const char*> table[] = {
      {{"--capture-delay", "10001"}, "10001"},
      {{"--media-address", "192.0.2.1"}, "--media-address 192.0.2.1:"},
      {{"--media-address", "example.org"}, "--media-address example.org:"},
      {{"--proxy", "proxy.example"}, "--proxy proxy.example:"},
      {{"--origin", "example.org"}, "--origin example.org:"},
      {{"--host", "https://example.org"}, "--host https://example.org:"},
      {{"--connects", "nan"}, "not a finite"}};
  for (const auto& [options, why] : table) {
    Served served(options);
    EXPECT_EQ(served.stop(), 1) << options[0];
    EXPECT_THAT(served.said(), HasSubstr(why)) << options[0];
  }
  Served served({"--proxy", "localhost", "--host", "Example.org:8443", "--media-address", "localhost",
                 "--capture-delay", "10000"});
  EXPECT_EQ(offer(served, browser_offer(), {{"Host", "example.org:8443"}, {"X-Forwarded-For", "192.0.2.1"}}).status,
            201u);
  EXPECT_EQ(offer(served, "v=0", {{"X-Forwarded-For", "192.0.2.1"}}).status, 400u);
  EXPECT_EQ(served.stop(), 0);
  EXPECT_THAT(served.said(), HasSubstr("192.0.2.1: 400, ")) << "trusts the proxy";
}

// Every failing offer gets one sentence, without GStreamer's messages.
TEST_F(LfServe, ExplainsUnusableOffers) {
  Served served({"--connects", "1000", "--address-views", "100", "--viewers", "100"});
  const std::string good = browser_offer();
  for (const std::string& bad :
       {with(with(with(good, " 108", " 0"), ":108 ", ":0 "), "VP8/", "VP9/"), with(good, "Yzk8", std::string(300, 'a')),
        with(good, "a=mid:0", "a=mid:"), with(good, "a=mid:1", "a=mid:0"), with(good, "a=setup:actpass", "a=setup:no"),
        with(good, "sha-256 D6", "sha-256 XX"), with(good, "a=group:BUNDLE 0 1", "a=group:BUNDLE 7 8"),
        with(good, "UDP/TLS/RTP/SAVPF", "RTP/AVP"), with(good, "lrnRvCr0XvB7VlGEhFXcIGWV", "x")}) {
    const Response response = offer(served, bad);
    EXPECT_TRUE(response.status == 201 || (response.status >= 400 && response.status < 500)) << response.status << bad;
    if (response.status == 201) continue;  // webrtcbin accepts more than required
    EXPECT_EQ(response.headers.at("Content-Type"), "application/problem+json") << response.body;
    EXPECT_THAT(response.body, Not(AnyOf(HasSubstr("webrtcbin"), HasSubstr("gst")))) << bad;
  }
  EXPECT_EQ(ask(served, "GET", "healthz").status, 200u);
  EXPECT_EQ(served.stop(), 0) << served.said();
}

TEST_F(LfServe, LimitsConnectsPerAddress) {
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

TEST_F(LfServe, ListensOnLoopbackByDefault) {
  Served served({"--listen", "0.0.0.0"});
  EXPECT_EQ(served.url(), "");
  EXPECT_EQ(served.stop(), 1);
  EXPECT_THAT(served.said(), HasSubstr("--tls-certificate"));
  Served insecure({"--listen", "0.0.0.0", "--insecure"});
  EXPECT_NE(insecure.url(), "") << insecure.said();
  EXPECT_EQ(insecure.stop(), 0);
}

TEST_F(LfServe, WarnsOfUnprotectedAccess) {
  Served open({"--listen", "0.0.0.0", "--insecure"});
  ASSERT_NE(open.url(), "") << open.said();
  EXPECT_EQ(open.stop(), 0);
  EXPECT_THAT(open.said(), AllOf(mentions("warning", "no token", "http://0.0.0.0:"), HasSubstr("--token-file")));
  Served here;
  EXPECT_EQ(here.stop(), 0);
  EXPECT_THAT(here.said(), Not(HasSubstr("no token")));
  const TempDir dir;
  dir.write_secret("token", "0123456789abcdef0123456789abcdef");
  Served closed({"--listen", "0.0.0.0", "--insecure", "--token-file", dir / "token"});
  EXPECT_EQ(closed.stop(), 0);
  EXPECT_THAT(closed.said(), Not(HasSubstr("no token")));
}

}  // namespace
}  // namespace lf::test
