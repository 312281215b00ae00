// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <libsoup/soup.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "serve/access.h"
#include "serve/http.h"

namespace lf::cameras {

// Serves a web page with live images of all cameras, where a person finds out which camera is where and swaps two
// cameras. The page is accessible on this machine only. All calls run on the thread of the default main context.
class IdentifyServer {
 public:
  struct Source {
    std::function<std::vector<uint8_t>()> jpeg;
    std::function<std::string()> state;
    // Swaps two cameras, given by their ids. Returns an empty text on success, otherwise the reason for the failure.
    // Leave this function empty to disable swapping.
    std::function<std::string(uint32_t a, uint32_t b)> swap;
  };
  IdentifyServer(int port, Source source);
  IdentifyServer(const IdentifyServer&) = delete;

  std::string url() const;

 private:
  void handle(SoupServerMessage* message, const std::string& path);
  void swap(SoupServerMessage* message);

  Source source_;
  lf::serve::Access access_;
  std::unique_ptr<lf::serve::HttpListener> listener_;
};

}  // namespace lf::cameras
