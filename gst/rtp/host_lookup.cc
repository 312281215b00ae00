// SPDX-License-Identifier: LGPL-2.1-or-later
#include "rtp/host_lookup.h"

#include <gio/gio.h>
#include <gst/gst.h>

#include "base/error.h"

namespace lf {
namespace {

// Cancels what takes too long, while it exists.
class TimeLimit {
 public:
  TimeLimit(GCancellable* cancellable, GstClockTime limit) {
    g_autoptr(GstClock) clock = gst_system_clock_obtain();
    id_ = gst_clock_new_single_shot_id(clock, gst_clock_get_time(clock) + limit);
    const auto cancel = [](GstClock*, GstClockTime, GstClockID, gpointer what) -> gboolean {
      g_cancellable_cancel(G_CANCELLABLE(what));
      return TRUE;
    };
    gst_clock_id_wait_async(id_, cancel, g_object_ref(cancellable), g_object_unref);
  }
  ~TimeLimit() {
    gst_clock_id_unschedule(id_);
    gst_clock_id_unref(id_);
  }
  TimeLimit(const TimeLimit&) = delete;

 private:
  GstClockID id_;
};

}  // namespace

std::vector<std::string> addresses_of(const std::string& host) {
  const bool has_scope = host.find('%') != std::string::npos;  // fe80::1%eth0
  if (has_scope || g_hostname_is_ip_address(host.c_str())) return {host};
  g_autoptr(GResolver) resolver = g_resolver_get_default();
  g_autoptr(GCancellable) cancellable = g_cancellable_new();
  g_autoptr(GError) error = nullptr;
  const TimeLimit limit(cancellable, kLookupSeconds * GST_SECOND);
  GList* found = g_resolver_lookup_by_name(resolver, host.c_str(), cancellable, &error);
  std::vector<std::string> addresses;
  for (GList* each = found; each; each = each->next) {
    g_autofree gchar* text = g_inet_address_to_string(G_INET_ADDRESS(each->data));
    addresses.emplace_back(text);
  }
  g_resolver_free_addresses(found);
  if (g_error_matches(error, G_IO_ERROR, G_IO_ERROR_CANCELLED))
    throw Error(host + ": no name server has answered within " + std::to_string(kLookupSeconds) + " s");
  if (error) throw Error(host + ": " + error->message);
  return addresses;
}

}  // namespace lf
