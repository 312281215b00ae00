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

// A page on this machine alone that shows a mosaic of cameras, and swaps two of them. On the thread of the default main
// context.
class IdentifyServer {
 public:
  struct Source {
    std::function<std::vector<uint8_t>()> jpeg;  // the mosaic as a JPEG file; may throw Error
    std::function<std::string()> state;          // JSON, see Mosaic
    // Swaps two cameras, by id; returns why not, "" where it is done. None: nobody may.
    std::function<std::string(uint32_t a, uint32_t b)> swap;
  };
  // Serves at this port, 0: any. Throws Error.
  IdentifyServer(int port, Source source);
  ~IdentifyServer();
  IdentifyServer(const IdentifyServer&) = delete;

  std::string url() const;

 private:
  void begin(SoupServerMessage* message);
  void handle(SoupServerMessage* message, const std::string& path);
  void swap(SoupServerMessage* message);

  Source source_;
  lf::serve::Access access_;
  SoupServer* server_;
  std::unique_ptr<lf::serve::Connections> connections_;
};

}  // namespace lf::cameras
