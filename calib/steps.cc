// SPDX-License-Identifier: LGPL-2.1-or-later
#include "steps.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <string_view>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_value.h"

extern char** environ;

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// What tells a file from one that was written anew: its size and when it was written.
json mark_of(const fs::path& path) {
  struct stat s = {};
  if (stat(path.c_str(), &s) != 0) return nullptr;
  return {s.st_size, s.st_mtim.tv_sec, s.st_mtim.tv_nsec};
}

json marks_of(const std::vector<std::string>& paths) {
  json marks = json::object();
  for (const std::string& path : paths) {
    if (!fs::is_directory(path)) {
      marks[path] = mark_of(path);
      continue;
    }
    for (const auto& entry : fs::recursive_directory_iterator(path))
      if (entry.is_regular_file()) marks[entry.path().string()] = mark_of(entry.path());
  }
  return marks;
}

// Standard output goes to `log`; standard error stays where progress bars are seen. Returns the exit status.
int run_program(const std::vector<std::string>& arguments, const std::string& log) {
  std::vector<char*> words;
  for (const std::string& argument : arguments) words.push_back(const_cast<char*>(argument.c_str()));
  words.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
  pid_t child = 0;
  const int error = posix_spawn(&child, "/proc/self/exe", &actions, nullptr, words.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) throw lf::Error(std::string("lf-calibrate can't be started: ") + std::strerror(error));
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFSIGNALED(status)) throw lf::Error("ended by signal " + std::to_string(WTERMSIG(status)));
  return WEXITSTATUS(status);
}

std::string last_line(const std::string& text) {
  const size_t end = text.find_last_not_of('\n');
  if (end == std::string::npos) return "";
  const size_t begin = text.rfind('\n', end);
  return text.substr(begin == std::string::npos ? 0 : begin + 1,
                     end - (begin == std::string::npos ? 0 : begin + 1) + 1);
}

}  // namespace

Steps::Steps(const std::string& folder) : folder_(folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw lf::Error(folder + ": can't be made: " + error.message());
}

bool Steps::run(const Step& step) {
  const std::string book = folder_ + "/steps.json", log = folder_ + "/" + step.name + ".log";
  json done = json::object();
  // A damaged book is as good as none.
  if (fs::exists(book)) try {
      done = json::parse(lf::read_text_file(book));
    } catch (const json::exception&) {
    }
  if (!done.is_object()) done = json::object();
  // A program that was built anew may know better.
  std::vector<std::string> inputs = step.inputs;
  inputs.push_back("/proc/self/exe");
  const json made_of = {{"arguments", step.arguments}, {"inputs", marks_of(inputs)}};
  const auto before = done.find(step.name);
  if (before != done.end() && before->is_object() && before->value("made_of", json()) == made_of &&
      before->value("outputs", json()) == marks_of(step.outputs) && before->value("said", json()).is_string()) {
    std::printf("%-11s as before: %s\n", step.name.c_str(), before->value("said", "").c_str());
    return true;
  }
  std::fflush(stdout);
  done.erase(step.name);
  // What an earlier run has made stays beside until the new output is there. A step that fails leaves it there.
  const auto aside = [](const std::string& output) { return output + ".before"; };
  for (const std::string& output : step.outputs)
    if (fs::exists(output)) fs::rename(output, aside(output));
  std::vector<std::string> words = {"lf-calibrate"};
  words.insert(words.end(), step.arguments.begin(), step.arguments.end());
  const int status = run_program(words, log);
  std::string said = last_line(lf::read_text_file(log));
  constexpr std::string_view kError = "error: ";
  if (status != 0 && said.starts_with(kError)) {
    failure_ = said.substr(kError.size());
    // It is on the terminal already; what was said before is the step's own last word.
    const std::string text = lf::read_text_file(log);
    said = last_line(text.substr(0, text.rfind(kError)));
  }
  const bool left_all = std::ranges::all_of(step.outputs, [](const std::string& path) { return fs::exists(path); });
  std::printf("%-11s %s%s\n", step.name.c_str(), said.empty() ? "failed" : said.c_str(),
              status == 0 ? ""
              : left_all  ? " (not all is well)"
                          : "");
  std::fflush(stdout);
  if (!left_all) return false;
  for (const std::string& output : step.outputs) fs::remove(aside(output));
  // What ended with an error, and left something all the same, is as it is until its inputs change.
  done[step.name] = {{"made_of", made_of}, {"outputs", marks_of(step.outputs)}, {"said", said}};
  lf::write_text_file(done.dump(1) + "\n", book);
  return true;
}
