// SPDX-License-Identifier: LGPL-2.1-or-later
#include "network/array_network.h"

#include <fcntl.h>
#include <signal.h>

#include "pipelines/gst_launch.h"
#include "rig/rig_json.h"
#include "scene/scene.h"
#include "view/navigator.h"
#include "view/view_path.h"

namespace lf::test {
namespace {

bool shell(const std::string& command) { return std::system((command + " >/dev/null 2>&1").c_str()) == 0; }

void must(const std::string& command) {
  if (!shell(command)) throw std::runtime_error("failed: " + command);
}

constexpr int kRequestPort = 6000, kAnswerPort = 6100;
constexpr int kBehindLink = 1000;  // sink port behind the link element
// The viewers' addresses end in 10 and 11 (10.77.0.10, 10.77.0.11), and the view id equals the last part of the
// address.
constexpr int kFirstHost = 3;

std::vector<std::string> host_names() {
  std::vector<std::string> names;
  for (int i = 0; i < ArrayNetwork::kNodes; i++) names.push_back("c" + std::to_string(i));
  names.push_back("compositor");
  for (int i = 0; i < ArrayNetwork::kViewers; i++) names.push_back("v" + std::to_string(i));
  return names;
}

// Returns the path of a viewer. All views differ, unless `still`.
std::vector<NamedView> path_of(const Rig& rig, int viewer, bool still) {
  std::vector<NamedView> views;
  const Viewpoint home = default_viewpoint(rig);
  for (int k = 0; k < ArrayNetwork::kViewsOfPath; k++) {
    const int i = still ? 2 : k;
    Viewpoint at = home;
    at.pose.position += Vec3(0.02 * (i - 2) + 0.01 * viewer, 0.015 * (2 * viewer - 1) * (i - 2), -0.3 - 0.05 * viewer);
    at.focus_distance = 2.2 + 0.2 * i;
    views.push_back({"view_" + std::to_string(k), 0.0, make_view(at, ArrayNetwork::kWidth, ArrayNetwork::kHeight)});
  }
  return views;
}

Image rgb_image(const uint8_t* bytes) {
  Image image(PixelFamily::kRgb, ArrayNetwork::kWidth, ArrayNetwork::kHeight);
  std::copy_n(bytes, image.data().size(), image.data().begin());
  return image;
}

}  // namespace

double now_seconds() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

Process::Process(const std::vector<std::string>& command) {
  int pipe_ends[2];
  if (pipe2(pipe_ends, O_CLOEXEC) != 0) throw std::runtime_error("no pipe");
  std::vector<char*> argv;
  for (const std::string& argument : command) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  pid_ = fork();
  if (pid_ == 0) {
    setpgid(0, 0);
    dup2(pipe_ends[1], STDOUT_FILENO);
    dup2(pipe_ends[1], STDERR_FILENO);
    execvp(argv[0], argv.data());
    _exit(127);
  }
  close(pipe_ends[1]);
  if (pid_ < 0) throw std::runtime_error("no process");
  setpgid(pid_, pid_);
  reader_ = std::thread([this, fd = pipe_ends[0]] { read(fd); });
}

Process::~Process() {
  if (!ended_) {
    signal(SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  reader_.join();
}

void Process::read(int fd) {
  std::string rest;
  char buffer[4096];
  while (const ssize_t n = ::read(fd, buffer, sizeof buffer)) {
    if (n < 0) break;
    rest.append(buffer, static_cast<size_t>(n));
    std::lock_guard lock(mutex_);
    for (size_t end; (end = rest.find('\n')) != std::string::npos; rest.erase(0, end + 1))
      lines_.push_back({now_seconds(), rest.substr(0, end)});
    written_.notify_all();
  }
  close(fd);
  std::lock_guard lock(mutex_);
  silent_ = true;
  written_.notify_all();
}

void Process::signal(int number) {
  if (!ended_) kill(-pid_, number);
}

bool Process::is_running() {
  if (!ended_ && waitpid(pid_, nullptr, WNOHANG) == pid_) ended_ = true;
  return !ended_;
}

std::vector<Process::Line> Process::lines(size_t without) const {
  std::lock_guard lock(mutex_);
  return {lines_.begin() + static_cast<ptrdiff_t>(std::min(without, lines_.size())), lines_.end()};
}

std::string Process::text() const {
  std::string all;
  for (const Line& line : lines()) all += line.text + "\n";
  return all;
}

bool Process::wait_for(const std::string& text, int count, double seconds) const {
  std::unique_lock lock(mutex_);
  int found = 0;
  size_t next = 0;
  const auto there = [&] {
    for (; next < lines_.size(); next++) found += lines_[next].text.find(text) != std::string::npos;
    return found >= count;
  };
  written_.wait_for(lock, std::chrono::duration<double>(seconds), [&] { return silent_ || there(); });
  return there();
}

std::string Network::unavailable() {
  if (geteuid() != 0) return "network namespaces need root";
  if (!shell("command -v ip")) return "the program ip (package iproute2) is not installed";
  const std::string name = "lf-probe-" + std::to_string(getpid());
  const bool works = shell("ip netns add " + name + " && ip -n " + name +
                           " link add v0 type veth peer name v1 && ip -n " + name + " link add b0 type bridge");
  shell("ip netns del " + name);
  return works ? "" : "this kernel lets no network namespace, veth or bridge be made";
}

Network::Network(const std::vector<std::string>& hosts, int first) : prefix_("lf" + std::to_string(getpid()) + "-") {
  const std::string bridge = name_space("switch");
  must("ip netns add " + bridge);
  must("ip -n " + bridge + " link add b0 type bridge && ip -n " + bridge + " link set b0 up");
  int number = first - 1;
  for (const std::string& host : hosts) {
    const std::string ns = name_space(host), port = "p" + std::to_string(++number);
    addresses_[host] = "10.77.0." + std::to_string(number);
    must("ip netns add " + ns);
    must("ip -n " + ns + " link add eth0 type veth peer name " + port + " netns " + bridge);
    must("ip -n " + bridge + " link set " + port + " master b0 up");
    must("ip -n " + ns + " addr add " + addresses_[host] + "/24 dev eth0");
    must("ip -n " + ns + " link set lo up && ip -n " + ns + " link set eth0 up");
    must("ip -n " + ns + " route add 224.0.0.0/4 dev eth0");
  }
}

Network::~Network() {
  for (const auto& [host, address] : addresses_) shell("ip netns del " + name_space(host));
  shell("ip netns del " + name_space("switch"));
}

std::unique_ptr<Process> Network::start(const std::string& host, const std::vector<std::string>& command) const {
  std::vector<std::string> inside = {"ip", "netns", "exec", name_space(host)};
  inside.insert(inside.end(), command.begin(), command.end());
  return std::make_unique<Process>(inside);
}

const char* const ArrayNetwork::kCameras[kNodes] = {"0-7", "8-15", "16-23", "24-31", "32-47", "48-63"};

ArrayNetwork::ArrayNetwork(const Options& options) : options_(options), network_(host_names(), kFirstHost) {
  const Rig rig = load_rig(rig_file());
  for (int i = 0; i < kViewers; i++)
    save_views(path_of(rig, i, options.surface), file("views" + std::to_string(i) + ".json"));
}

// Returns the rig file of the cameras. The first call renders their pictures.
std::string ArrayNetwork::rig_file() {
  static const TempDir film;
  static const std::string path = [] {
    const Outcome filmed = run_program("lf-scene", "--out '" + film.path() + "' --frames 1 --samples 1 --width " +
                                                       std::to_string(kWidth) + " --height " + std::to_string(kHeight));
    if (filmed.status != 0) throw std::runtime_error(filmed.output);
    Rig rig = load_rig(film / "rig.json");
    for (Camera& camera : rig.cameras) camera.source.clear();  // use the first frame, a still image, forever
    save_rig(rig, film / "rig.json");
    return film / "rig.json";
  }();
  return path;
}

std::vector<std::string> ArrayNetwork::with_environment(std::vector<std::string> command) const {
  command.insert(command.begin(),
                 {"env", "GST_PLUGIN_PATH=" LF_PLUGIN_DIR, "GST_REGISTRY=" LF_PLUGIN_DIR "/test-registry.bin"});
  return command;
}

void ArrayNetwork::start_link(const std::string& host, int port, const std::string& to, int to_port) {
  const std::string name = host + ":" + std::to_string(port);
  if (options_.link.empty() || links_[name]) return;
  const std::string line = "gst-launch-1.0 -q udpsrc buffer-size=8388608 port=" + std::to_string(port) + " ! " +
                           options_.link + " ! udpsink sync=false async=false host=" + to +
                           " port=" + std::to_string(to_port);
  links_[name] = network_.start(host, with_environment({"sh", "-c", line}));
}

void ArrayNetwork::start_node(int i) {
  const std::string host = "c" + std::to_string(i);
  const bool linked = !options_.link.empty();
  const int requests = kRequestPort + (linked ? kBehindLink : 0), answers = kAnswerPort + i;
  const std::string compositor = network_.address("compositor");
  start_link(host, kRequestPort, "127.0.0.1", requests);
  start_link(host, answers, compositor, answers);
  const std::string line = "gst-launch-1.0 -m lfnodesink rig=" + rig_file() + " cameras=" + kCameras[i] +
                           " node=" + std::to_string(i) + " listen=" + std::to_string(requests) +
                           " answers=" + (linked ? "127.0.0.1" : compositor) + ":" + std::to_string(answers) +
                           " framerate=" + std::to_string(options_.framerate) + "/1 max-bitrate=1000000000 " +
                           options_.camera;
  nodes_[i].reset();
  nodes_[i] = network_.start(host, with_environment({"sh", "-c", "exec " + line}));
}

void ArrayNetwork::start_compositor() {
  lines_read_ = 0;
  pictures_.clear();
  const int requests = kViewerPort + (options_.link.empty() ? 0 : kBehindLink);
  start_link("compositor", kViewerPort, "127.0.0.1", requests);
  std::string nodes, peers = "127.0.0.1", views;
  for (int i = 0; i < kNodes; i++)
    nodes += (i ? "," : "") + network_.address("c" + std::to_string(i)) + ":" + std::to_string(kRequestPort) + ":" +
             std::to_string(kAnswerPort + i);
  for (int i = 0; i < kViewers; i++) {
    const std::string number = std::to_string(i), viewer = network_.address("v" + number);
    peers += "," + viewer;
    views += " v." + (i ? "src_" + std::to_string(i - 1) : "src") +
             " ! queue ! videoconvert ! video/x-raw,format=RGB ! tee name=t" + number + "  t" + number +
             ". ! queue ! multifilesink async=false sync=false max-files=100 location=" + file(number + "-%d.rgb") +
             "  t" + number +
             ". ! queue ! videoconvert ! video/x-raw,format=I420 ! jpegenc ! rtpjpegpay ! udpsink host=" + viewer +
             " port=" + std::to_string(kVideoPort) + " sync=false async=false ";
  }
  const std::string line = "gst-launch-1.0 -m lfviewsrc name=v rig=" + rig_file() + " nodes=" + nodes +
                           " listen=" + std::to_string(requests) + " peers=" + peers +
                           " latency=" + std::to_string(options_.latency) + "000000 post-messages=true" +
                           (options_.surface ? "" : " focus=plane") + views;
  compositor_ = network_.start("compositor", with_environment({"sh", "-c", "exec " + line}));
}

void ArrayNetwork::start_viewer(int i) {
  const std::string number = std::to_string(i);
  const std::string compositor = network_.address("compositor");
  const std::string line =
      "gst-launch-1.0 -m lfviewrequest view-id=" + number +
      " navigation-element=pictures is-live=true loop=true rig=" + rig_file() +
      " location=" + file("views" + number + ".json") + " framerate=" + std::to_string(options_.framerate) +
      "/1 capture-delay=100000000 " + options_.viewer[i] +
      " ! rtplfpay ! udpsink sync=false async=false host=" + compositor + " port=" + std::to_string(kViewerPort) +
      "  udpsrc port=" + std::to_string(kVideoPort) +
      " caps=application/x-rtp,media=video,clock-rate=90000,encoding-name=JPEG,payload=26 ! lfrtpgate peers=" +
      compositor +
      " ! rtpjpegdepay ! jpegdec name=pictures ! videoconvert ! "
      "fakesink name=shown silent=false sync=false async=false";
  viewers_[i] = network_.start("v" + number, with_environment({"sh", "-c", "exec " + line}));
}

void ArrayNetwork::start_all() {
  for (int i = 0; i < kNodes; i++) start_node(i);
  start_compositor();
  for (int i = 0; i < kViewers; i++) start_viewer(i);
}

std::vector<ArrayNetwork::Picture> ArrayNetwork::pictures(int view) const {
  const auto value_of = [](const std::string& text, const std::string& name) -> const char* {
    const size_t at = text.find(name);
    return at == std::string::npos ? nullptr : text.c_str() + at + name.size();
  };
  for (const Process::Line& line : compositor_->lines(lines_read_)) {
    lines_read_++;
    const char *id = value_of(line.text, "lightfield-view, view-id=(uint)"),
               *sequence = value_of(line.text, " sequence=(uint)"),
               *complete = value_of(line.text, " complete=(boolean)"),
               *missing = value_of(line.text, " missing=(uint)"), *bytes = value_of(line.text, " bytes=(guint64)"),
               *latency = value_of(line.text, " latency-ns=(guint64)");
    if (!id || !sequence || !complete || !missing || !bytes || !latency) continue;
    pictures_[std::atoi(id)].push_back({line.time, static_cast<uint32_t>(std::strtoul(sequence, nullptr, 10)),
                                        *complete == 't', static_cast<unsigned>(std::strtoul(missing, nullptr, 10)),
                                        std::strtod(latency, nullptr) / 1e6, std::strtoull(bytes, nullptr, 10)});
  }
  return pictures_[view];
}

bool ArrayNetwork::wait_for_pictures(int view, int count) const {
  const std::string message = "lightfield-view, view-id=(uint)" + std::to_string(view);
  return compositor_->wait_for(message, static_cast<int>(pictures(view).size()) + count);
}

Image ArrayNetwork::next_picture(int view, uint32_t* sequence) {
  const size_t before = pictures(view).size();
  const double begun = now_seconds();
  while (now_seconds() < begun + 30) {
    const std::vector<Picture> all = pictures(view);
    for (size_t k = before; k < all.size(); k++) {
      const std::vector<uint8_t> bytes = read_bytes(file(std::to_string(view) + "-" + std::to_string(k) + ".rgb"));
      if (!all[k].complete || bytes.size() != 3u * kWidth * kHeight) continue;
      *sequence = all[k].sequence;
      return rgb_image(bytes.data());
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  throw std::runtime_error("view " + std::to_string(view) + ": no complete picture within half a minute:\n" +
                           compositor_->text());
}

std::vector<std::pair<Image, uint32_t>> ArrayNetwork::latest_pictures(int view) const {
  std::vector<std::pair<Image, uint32_t>> kept;
  const std::vector<Picture> all = pictures(view);
  for (size_t k = all.size() > 90 ? all.size() - 90 : 0; k < all.size(); k++) {
    const std::vector<uint8_t> bytes = read_bytes(file(std::to_string(view) + "-" + std::to_string(k) + ".rgb"));
    if (bytes.size() == 3u * kWidth * kHeight) kept.emplace_back(rgb_image(bytes.data()), all[k].sequence);
  }
  return kept;
}

std::vector<Image> ArrayNetwork::truth(int view) const {
  std::vector<Image> images;
  for (const NamedView& named : load_views(file("views" + std::to_string(view) + ".json")))
    images.push_back(render_scene({named.view.width, named.view.height, named.view.lens, named.view.pose}, 0, 1));
  return images;
}

std::vector<Image> ArrayNetwork::single_host(int view, const std::string& out_of_service) const {
  const std::string out = file("reference.rgb"), rig = rig_file();
  const std::string without = out_of_service.empty() ? "" : " out-of-service=" + out_of_service;
  const Outcome run =
      gst_launch("lfviewrequest rig=" + rig + " location=" + file("views" + std::to_string(view) + ".json") + without +
                 " ! tee name=r  r. ! queue ! n.request  lfcameranode name=n rig=" + rig +
                 " ! c.sink_0  r. ! queue ! c.request  lfcompositor name=c ! videoconvert ! " +
                 "video/x-raw,format=RGB ! filesink location=" + out);
  if (run.status != 0) throw std::runtime_error(run.output);
  const std::vector<uint8_t> bytes = read_bytes(out);
  std::vector<Image> images;
  constexpr size_t kBytes = 3u * kWidth * kHeight;
  for (size_t at = 0; at + kBytes <= bytes.size(); at += kBytes) images.push_back(rgb_image(&bytes[at]));
  return images;
}

}  // namespace lf::test
