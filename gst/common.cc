// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common.h"

#include <filesystem>
#include <map>
#include <mutex>

#include "rig/rig_json.h"

namespace lf {

std::shared_ptr<const Rig> shared_rig(const std::string& path) {
  struct Entry {
    std::weak_ptr<const Rig> rig;
    std::filesystem::file_time_type modified;
  };
  static std::mutex mutex;
  static std::map<std::string, Entry> cache;

  std::error_code ignored;  // load_rig() reports a file that is not there
  const std::filesystem::file_time_type modified = std::filesystem::last_write_time(path, ignored);
  std::lock_guard lock(mutex);
  Entry& entry = cache[path];
  std::shared_ptr<const Rig> rig = entry.rig.lock();
  if (!rig || entry.modified != modified) {
    rig = std::make_shared<const Rig>(load_rig(path));
    entry = {rig, modified};
  }
  return rig;
}

bool is_in_process_query(GstQuery* query) {
  const GstStructure* structure = GST_QUERY_TYPE(query) == GST_QUERY_CUSTOM ? gst_query_get_structure(query) : nullptr;
  return structure && gst_structure_has_name(structure, LF_IN_PROCESS_QUERY);
}

bool compositor_is_near(GstPad* src) {
  GstQuery* query = gst_query_new_custom(GST_QUERY_CUSTOM, gst_structure_new_empty(LF_IN_PROCESS_QUERY));
  const bool near = gst_pad_peer_query(src, query);
  gst_query_unref(query);
  return near;
}

}  // namespace lf
