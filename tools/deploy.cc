// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lf_rig.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include <gio/gio.h>
#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/json_value.h"
#include "bins/discovery.h"
#include "rig/rig.h"
#include "rig/rig_json.h"
#include "terminal.h"
#include "view/view_path.h"

namespace {

namespace fs = std::filesystem;

constexpr int kRequestPort = 6000, kAnswerPort = 6100, kWebPort = 8080;
constexpr int kCameraMetricsPort = 9110, kCompositorMetricsPort = 9120;
constexpr char kRig[] = "/etc/lightfield/rig.json";

struct Host {
  std::string name, address, options;
  std::string cameras;  // of a camera host
  std::string output;   // of a compositor: the elements behind lfviewsrc
};

// The clients of the camera hosts are the servers, then the compositors. Client c sends its requests to port
// kRequestPort + c of each camera host, and receives the answers of camera host n at its port kAnswerPort + n.
struct Inventory {
  std::string folder, rig, rig_hash, key;
  std::map<std::string, std::string> views;  // name and text of each camera path
  std::vector<Host> cameras, servers, compositors;
  std::string proxy, proxy_config, public_name;

  std::vector<Host> clients() const {
    std::vector<Host> all = servers;
    all.insert(all.end(), compositors.begin(), compositors.end());
    return all;
  }
};

// Names become folders, names of services and words of configuration files.
std::string word(const lf::JsonValue& value, const char* pattern) {
  const std::string text = value.text();
  if (!std::regex_match(text, std::regex(pattern))) value.fail("\"" + text + "\" must match " + pattern);
  return text;
}
// Returns the usual spelling of an IP address, so that equal addresses are equal texts.
std::string address_of(const lf::JsonValue& host) {
  const lf::JsonValue value = host.at("address");
  g_autoptr(GInetAddress) address = g_inet_address_new_from_string(value.text().c_str());
  if (!address) value.fail("\"" + value.text() + "\" is not an IP address");
  g_autofree gchar* text = g_inet_address_to_string(address);
  return text;
}
std::string line_of(const lf::JsonValue& host, const char* key) {
  const auto value = host.find(key);
  if (!value && std::string(key) == "output") (void)host.at(key);  // throws
  if (value && value->text().find('\n') != std::string::npos) value->fail("must be one line");
  return value ? value->text() : "";
}

// `names` and `addresses` contain the names and addresses of earlier hosts. Two hosts with the same address would use
// the same ports.
std::vector<Host> hosts_of(const lf::JsonValue& root, const char* key, std::set<std::string>& names,
                           std::set<std::string>& addresses) {
  std::vector<Host> hosts;
  const auto list = root.find(key);
  for (const lf::JsonValue& value : list ? list->elements() : std::vector<lf::JsonValue>()) {
    Host& host = hosts.emplace_back();
    host.name = word(value.at("name"), "[A-Za-z0-9]{1,32}");
    if (!names.insert(host.name).second) value.at("name").fail("\"" + host.name + "\" is also another host");
    host.address = address_of(value);
    if (!addresses.insert(host.address).second)
      value.at("address").fail(host.address + " is also the address of another host, which uses the same ports");
    host.options = line_of(value, "options");
    if (std::string(key) == "cameras") host.cameras = word(value.at("cameras"), "[0-9,-]+");
    if (std::string(key) == "compositors") host.output = line_of(value, "output");
  }
  return hosts;
}

Inventory load_inventory(const std::string& path) {
  const nlohmann::json json = lf::parse_json(lf::read_text_file(path), path);
  const lf::JsonValue root(json, path);
  root.require_format("lightfield-inventory", 1);
  Inventory inventory;
  inventory.folder = fs::path(path).parent_path();
  const auto file = [&](const lf::JsonValue& value) { return (fs::path(inventory.folder) / value.text()).string(); };
  inventory.rig = file(root.at("rig"));
  inventory.key = file(root.at("key"));
  std::set<std::string> names = {"proxy"};
  std::set<std::string> of_cameras, of_clients;  // a camera host can also be a client: its ports differ
  inventory.cameras = hosts_of(root, "cameras", names, of_cameras);
  inventory.servers = hosts_of(root, "servers", names, of_clients);
  inventory.compositors = hosts_of(root, "compositors", names, of_clients);
  if (inventory.cameras.empty()) root.fail("cameras: no camera hosts");
  if (inventory.clients().empty()) root.fail("servers, compositors: no hosts that make pictures");
  if (const auto proxy = root.find("proxy")) {
    inventory.proxy = address_of(*proxy);
    inventory.public_name = word(proxy->at("host"), "[A-Za-z0-9.:-]+");
    inventory.proxy_config = lf::read_text_file(file(proxy->at("template")));
    if (inventory.servers.empty()) root.fail("proxy: there are no servers");
  } else if (inventory.servers.size() > 1) {
    root.fail("proxy: missing, but there are several servers");
  } else if (!inventory.servers.empty() && inventory.servers[0].options.find("--listen ") == std::string::npos) {
    root.fail("servers[0].options: need --listen, because browsers reach the server without a proxy");
  }
  const auto views = root.find("views");
  for (const lf::JsonValue& value : views ? views->elements() : std::vector<lf::JsonValue>()) {
    const std::string path = file(value.at("file"));
    (void)lf::load_views(path);  // throws if it is invalid
    const std::string name = word(value.at("name"), "[A-Za-z0-9]{1,32}");
    if (!inventory.views.emplace(name, lf::read_text_file(path)).second)
      value.at("name").fail("\"" + name + "\" is also another path");
  }
  const lf::Rig rig = lf::load_rig(inventory.rig);
  inventory.rig_hash = lf::rig_hash_text(rig);
  std::map<uint32_t, std::string> owners;
  for (const Host& host : inventory.cameras)
    for (const lf::CameraIndex camera : lf::parse_camera_list(rig, host.cameras)) {
      const auto [owner, is_new] = owners.emplace(rig.cameras[camera].id, host.name);
      if (!is_new)
        root.fail("camera " + std::to_string(owner->first) + " belongs to " + owner->second + " and to " + host.name);
    }
  for (const lf::Camera& camera : rig.cameras)
    if (!owners.contains(camera.id)) root.fail("camera " + std::to_string(camera.id) + " belongs to no host");
  return inventory;
}

std::string in_brackets(const std::string& address) {
  return address.find(':') == std::string::npos ? address : "[" + address + "]";
}
std::string place(const std::string& address, size_t port) { return in_brackets(address) + ':' + std::to_string(port); }

template <class Item>
std::string joined(size_t count, const Item& item) {
  std::string text;
  for (size_t i = 0; i < count; i++) text += (i > 0 ? "," : "") + item(i);
  return text;
}

std::string with_space(const std::string& text) { return text.empty() ? "" : " " + text; }

// The folder of a host has its files at their places in the file system of the host. Services of that host read them as
// another user, so their modes do not depend on the umask.
class Folder {
 public:
  Folder(const std::string& all, const std::string& host) : root_(fs::path(all) / host) {}
  void write(const std::string& name, const std::string& text) const {
    const fs::path path = root_ / name;
    fs::create_directories(path.parent_path());
    lf::write_text_file(text, path);
    fs::permissions(path, fs::perms(0644));
    for (fs::path folder = path; folder != root_;) {
      folder = folder.parent_path();
      fs::permissions(folder, fs::perms(0755));
    }
  }
  void write_shared(const Inventory& inventory, const std::string& secret) const {
    write("etc/lightfield/rig.json", lf::read_text_file(inventory.rig));
    const fs::path secrets = root_ / "etc/lightfield/secrets", key = secrets / "key";
    fs::create_directories(secrets);
    fs::permissions(secrets, fs::perms::owner_all);  // before the key exists
    lf::write_text_file(secret, key);
    fs::permissions(key, fs::perms::owner_read | fs::perms::owner_write);
  }

 private:
  fs::path root_;
};

std::string camera_config(const Inventory& inventory, size_t node) {
  const Host& host = inventory.cameras[node];
  const std::vector<Host> clients = inventory.clients();
  const auto listen = [&](size_t client) { return place(host.address, kRequestPort + client); };
  const auto answer = [&](size_t client) { return place(clients[client].address, kAnswerPort + node); };
  return "LIGHTFIELD_OPTIONS=rig=" + std::string(kRig) + " cameras=" + host.cameras + " node=" + std::to_string(node) +
         " listen=" + joined(clients.size(), listen) + " answers=" + joined(clients.size(), answer) +
         with_space(host.options) + "\nLIGHTFIELD_METRICS=" + place(host.address, kCameraMetricsPort) + '\n';
}

std::string connection(const Inventory& inventory, size_t node, size_t client) {
  return place(inventory.cameras[node].address, kRequestPort + client) + ':' +
         place(inventory.clients()[client].address, kAnswerPort + node);
}
std::string nodes_of(const Inventory& inventory, size_t client) {
  return joined(inventory.cameras.size(), [&](size_t node) { return connection(inventory, node, client); });
}

// avahi-daemon announces the host, so that clients with nodes=auto find it (gst/bins/discovery.h).
std::string announcement(const Inventory& inventory, size_t node) {
  const Host& host = inventory.cameras[node];
  std::string text =
      "<?xml version=\"1.0\" standalone='no'?>\n<!DOCTYPE service-group SYSTEM \"avahi-service.dtd\">\n"
      "<service-group>\n  <name>Light field cameras " +
      host.name + "</name>\n  <service>\n    <type>" + lf::AnnouncedHost::kType + "</type>\n    <port>" +
      std::to_string(kRequestPort) + "</port>\n";
  const auto add = [&](const std::string& field) {
    constexpr size_t kMaxField = 255;  // RFC 6763, section 6.1
    if (field.size() > kMaxField)
      throw lf::Error(host.name + ": the list of cameras is too long for an announcement: use ranges such as 0-31");
    text += "    <txt-record>" + field + "</txt-record>\n";
  };
  add("rig=" + inventory.rig_hash);
  add("cameras=" + host.cameras);
  for (size_t client = 0; client < inventory.clients().size(); client++)
    add("client" + std::to_string(client) + '=' + connection(inventory, node, client));
  return text + "  </service>\n</service-group>\n";
}

std::string views_file(const std::string& name) { return "etc/lightfield/views/" + name + ".json"; }

std::string server_config(const Inventory& inventory, size_t client) {
  const Host& host = inventory.servers[client];
  std::string options = "--rig " + std::string(kRig) + " --nodes " + nodes_of(inventory, client) +
                        " --key-file /run/lightfield-serve/key";
  if (!inventory.proxy.empty())
    options += " --replica " + host.name + " --listen " + host.address + " --insecure --proxy " + inventory.proxy +
               " --host " + inventory.public_name + " --media-address " + host.address;
  for (const auto& [name, text] : inventory.views) options += " --path " + name + "=/" + views_file(name);
  return "LIGHTFIELD_OPTIONS=" + options + with_space(host.options) + '\n';
}

std::string compositor_config(const Inventory& inventory, size_t index) {
  const Host& host = inventory.compositors[index];
  return "LIGHTFIELD_PIPELINE=rig=" + std::string(kRig) +
         " nodes=" + nodes_of(inventory, inventory.servers.size() + index) + with_space(host.options) + " ! " +
         host.output + "\nLIGHTFIELD_METRICS=" + place(host.address, kCompositorMetricsPort) + '\n';
}

// Replaces the server lines of each backend of the template.
std::string proxy_config(const Inventory& inventory) {
  std::string config;
  bool is_replaced = false;
  const std::regex server("(  server )\\S+ \\S+(.*)");
  for (size_t at = 0; at < inventory.proxy_config.size();) {
    const size_t end = std::min(inventory.proxy_config.find('\n', at), inventory.proxy_config.size());
    const std::string line = inventory.proxy_config.substr(at, end - at);
    at = end + 1;
    if (std::smatch match; !std::regex_match(line, match, server)) {
      config += line + '\n';
      if (!line.empty() && line.front() != ' ' && line.front() != '#') is_replaced = false;  // another section
    } else if (!is_replaced) {
      for (const Host& host : inventory.servers)
        config += match[1].str() + host.name + ' ' + place(host.address, kWebPort) +
                  std::regex_replace(match[2].str(), std::regex("(track \\S+/)\\S+"), "$01" + host.name) + '\n';
      is_replaced = true;
    }
  }
  return config;
}

nlohmann::json targets(const Inventory& inventory) {
  nlohmann::json servers = nlohmann::json::array(), hosts = nlohmann::json::array();
  for (const Host& host : inventory.servers) servers.push_back(place(host.address, kWebPort));
  for (const Host& host : inventory.cameras) hosts.push_back(place(host.address, kCameraMetricsPort));
  for (const Host& host : inventory.compositors) hosts.push_back(place(host.address, kCompositorMetricsPort));
  return {{{"labels", {{"job", "lightfield"}}}, {"targets", servers}},
          {{"labels", {{"job", "lightfield-hosts"}}}, {"targets", hosts}}};
}

void deploy(const std::string& path, const std::string& out) {
  const Inventory inventory = load_inventory(path);
  std::string secret = lf::read_secret_file(inventory.key);
  const auto wipe = [](std::string* text) { lf::wipe(*text); };
  const std::unique_ptr<std::string, decltype(wipe)> wiped_at_the_end(&secret, wipe);
  fs::create_directories(out);
  fs::permissions(out, fs::perms::owner_all);  // it contains the key
  const auto write = [&](const Host& host, const std::string& file, const std::string& text, const char* service) {
    const Folder folder(out, host.name);
    folder.write_shared(inventory, secret);
    folder.write("etc/lightfield/" + file, text);
    terminal::print("%s: %s\n", host.name.c_str(), service);
  };
  for (size_t i = 0; i < inventory.cameras.size(); i++) {
    const Host& host = inventory.cameras[i];
    write(host, "camera-" + host.name + ".conf", camera_config(inventory, i),
          ("lightfield-camera@" + host.name).c_str());
    Folder(out, host.name).write("etc/avahi/services/lightfield.service", announcement(inventory, i));
  }
  for (const Host& host : inventory.clients())
    for (const auto& [name, text] : inventory.views) Folder(out, host.name).write(views_file(name), text);
  for (size_t i = 0; i < inventory.servers.size(); i++)
    write(inventory.servers[i], "serve.conf", server_config(inventory, i), "lightfield-serve");
  for (size_t i = 0; i < inventory.compositors.size(); i++) {
    const Host& host = inventory.compositors[i];
    write(host, "compositor-" + host.name + ".conf", compositor_config(inventory, i),
          ("lightfield-compositor@" + host.name).c_str());
  }
  if (!inventory.proxy.empty()) {
    Folder(out, "proxy").write("etc/haproxy/haproxy.cfg", proxy_config(inventory));
    terminal::print("proxy: haproxy\n");
  }
  lf::write_text_file(targets(inventory).dump(1) + '\n', fs::path(out) / "prometheus-targets.json");
}

}  // namespace

void add_deploy_command(cli::App& app) {
  struct Arguments {
    std::string inventory, out;
  };
  const auto arguments = std::make_shared<Arguments>();
  cli::App* command = app.add_subcommand(
      "deploy",
      "Writes the configuration of every host from an inventory, which lists the camera hosts, servers and "
      "compositors. Each host gets a folder with its files, to be copied to the root folder of the host. Prints the "
      "service of each host");
  command->add_option("INVENTORY", arguments->inventory, "Inventory file")->required();
  command
      ->add_option("--out", arguments->out, "Folder to write. Other users cannot read it, because it contains the key")
      ->required()
      ->type_name("FOLDER");
  command->callback([arguments] { deploy(arguments->inventory, arguments->out); });
}
