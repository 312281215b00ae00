// SPDX-License-Identifier: LGPL-2.1-or-later
#include "solver_log.h"

#include <glog/logging.h>

#include <map>
#include <mutex>

namespace lf {
namespace {

class SolverLog : public google::LogSink {
 public:
  void send(google::LogSeverity, const char*, const char*, int, const google::LogMessageTime&, const char* message,
            size_t length) override {
    constexpr size_t kMaxTexts = 16;
    const std::lock_guard lock(mutex_);
    const std::string text(message, length);
    if (counts_.size() < kMaxTexts || counts_.contains(text)) counts_[text]++;
  }
  std::vector<std::string> texts() const {
    const std::lock_guard lock(mutex_);
    std::vector<std::string> all;
    for (const auto& [text, count] : counts_)
      all.push_back(count > 1 ? text + " (" + std::to_string(count) + " times)" : text);
    return all;
  }

 private:
  mutable std::mutex mutex_;
  std::map<std::string, int> counts_;
};

SolverLog& solver_log() {
  static SolverLog log;
  return log;
}

}  // namespace

void capture_solver_messages() {
  static std::once_flag once;
  std::call_once(once, [] {
    if (!google::IsGoogleLoggingInitialized()) google::InitGoogleLogging("lightfield");
    FLAGS_logtostderr = FLAGS_alsologtostderr = false;
    FLAGS_stderrthreshold = google::GLOG_FATAL;
    for (int severity = google::GLOG_INFO; severity < google::NUM_SEVERITIES; severity++)
      google::SetLogDestination(severity, "");
    google::AddLogSink(&solver_log());
  });
}

std::vector<std::string> solver_messages() { return solver_log().texts(); }

}  // namespace lf
