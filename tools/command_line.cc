// SPDX-License-Identifier: LGPL-2.1-or-later
#include "command_line.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <list>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "base/file.h"
#include "rig/source_security.h"
#include "terminal.h"

namespace cli {

namespace {

// Rejects "nan" and "inf". CLI11's range checks let "nan" pass, because every comparison with NaN is false.
std::string refuse_not_finite(std::string& text) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  return end != text.c_str() && !std::isfinite(value) ? text + " is not a finite number" : "";
}

template <class Value>
bool is_default(const Value& value) {
  if constexpr (std::is_arithmetic_v<Value>)
    return value > 0;
  else if constexpr (requires { value.empty(); })
    return !value.empty();
  else
    return false;
}

template <class Value>
constexpr bool is_real = false;
template <>
constexpr bool is_real<double> = true;
template <>
constexpr bool is_real<float> = true;
template <>
constexpr bool is_real<std::optional<double>> = true;
template <>
constexpr bool is_real<std::vector<double>> = true;

}  // namespace

Check::Check(const CLI::Validator& validator) : validator_(std::make_shared<CLI::Validator>(validator)) {}

Check Range(int least, int most) { return Check(CLI::Range(least, most)); }
Check Range(double least, double most) { return Check(CLI::Range(least, most)); }
Check IsMember(std::initializer_list<const char*> texts) {
  return Check(CLI::IsMember(std::vector<std::string>(texts.begin(), texts.end())));
}
Check IsMember(std::initializer_list<int> numbers) { return Check(CLI::IsMember(std::vector<int>(numbers))); }
const Check PositiveNumber(CLI::PositiveNumber), NonNegativeNumber(CLI::NonNegativeNumber),
    ExistingPath(CLI::ExistingPath);

Option* Option::required() {
  option_->required()->default_str("");
  return this;
}

Option* Option::capture_default_str() {
  option_->capture_default_str();
  return this;
}

Option* Option::type_name(const std::string& name) {
  option_->type_name(name);
  return this;
}

Option* Option::check(const Check& check) {
  option_->check(check.validator());
  return this;
}

Option* Option::delimiter(char between) {
  option_->delimiter(between);
  return this;
}

Option* Option::needs(const Option* other) {
  option_->needs(other->option_);
  return this;
}

Option* Option::excludes(const Option* other) {
  option_->excludes(other->option_);
  return this;
}

Option::operator bool() const { return option_->count() > 0; }

struct App::Parts {
  std::shared_ptr<CLI::App> app;
  std::shared_ptr<int> status;  // exit status, shared by all commands
  int error_status = 1;
  std::vector<std::unique_ptr<App>> commands;
  std::list<Option> options;
};

App::App(const std::string& description, const std::string& name)
    : App(std::make_shared<CLI::App>(description, name), std::make_shared<int>(0)) {}
App::App(std::shared_ptr<CLI::App> app, std::shared_ptr<int> status)
    : parts_(new Parts{.app = std::move(app), .status = std::move(status), .commands = {}, .options = {}}) {}
App::~App() = default;

template <class Value>
Option* App::add_option(const std::string& name, Value& variable, const std::string& help) {
  CLI::Option* const option = parts_->app->add_option(name, variable, help);
  if (is_default(variable)) option->capture_default_str();
  if constexpr (is_real<Value>) option->check(CLI::Validator(refuse_not_finite, ""));
  return &parts_->options.emplace_back(option);
}

Option* App::add_flag(const std::string& name, bool& variable, const std::string& help) {
  return &parts_->options.emplace_back(parts_->app->add_flag(name, variable, help));
}

App* App::add_subcommand(const std::string& name, const std::string& help) {
  CLI::App* const command = parts_->app->add_subcommand(name, help);
  return parts_->commands.emplace_back(new App(parts_->app->get_subcommand_ptr(command), parts_->status)).get();
}

App* App::add_option_group(const std::string& name) {
  CLI::App* const group = parts_->app->add_option_group(name);
  return parts_->commands.emplace_back(new App(parts_->app->get_subcommand_ptr(group), parts_->status)).get();
}

App* App::excludes_options_of(const App& other) {
  for (CLI::Option* option : other.parts_->app->get_options())
    if (option != other.parts_->app->get_help_ptr()) parts_->app->excludes(option);
  return this;
}

App* App::require_subcommand(size_t count) {
  parts_->app->require_subcommand(static_cast<int>(count));
  return this;
}

App* App::require_subcommand(size_t least, size_t most) {
  parts_->app->require_subcommand(least, most);
  return this;
}

App* App::require_option(size_t count) {
  parts_->app->require_option(static_cast<int>(count));
  return this;
}

void add_trust_option(App& app, bool& trusted) {
  app.add_flag("--trust-rig", trusted,
               "Allow the rig file to use any GStreamer element as a camera source. Such a file can write files and "
               "run programs, so use this option only with rig files from people you trust");
}

void App::set_callback(std::function<int()> job) {
  parts_->app->callback([status = parts_->status, job = std::move(job)] { *status = job(); });
}

void App::set_error_status(int status) { parts_->error_status = status; }

App::operator bool() const { return parts_->app->parsed(); }

namespace {

// Prepares an error for the terminal. Removes secrets and control characters, and limits the length.
std::string printable(const std::string& what) {
  constexpr size_t kMost = 4000;
  return lf::terminal_text(lf::without_staging(lf::redacted_location(what.substr(0, kMost))));
}

// Number of insertions, removals and replacements of characters that turn `a` into `b`.
size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<size_t> row(b.size() + 1);
  for (size_t j = 0; j <= b.size(); j++) row[j] = j;
  for (size_t i = 1; i <= a.size(); i++) {
    size_t diagonal = std::exchange(row[0], i);
    for (size_t j = 1; j <= b.size(); j++)
      diagonal = std::exchange(row[j], std::min({row[j] + 1, row[j - 1] + 1, diagonal + (a[i - 1] != b[j - 1])}));
  }
  return row[b.size()];
}

bool has_options(CLI::App& command, const std::vector<std::string>& words) {
  return std::ranges::all_of(words, [&](const std::string& word) {
    return !word.starts_with("--") || command.get_option_no_throw(word.substr(0, word.find('='))) ||
           std::ranges::any_of(command.get_subcommands({}), [&](CLI::App* part) {
             return part->get_name().empty() && part->get_option_no_throw(word.substr(0, word.find('=')));
           });
  });
}

// Returns the likely command line: the command most similar to the first word replaces this word; otherwise the only
// command with all given options is inserted. Returns "" if neither exists.
std::string likely_line(const std::vector<CLI::App*>& commands, std::vector<std::string> words) {
  constexpr size_t kMaxTypos = 2;
  const bool has_word = !words.empty() && !words[0].starts_with("-");
  const auto typos = [&](CLI::App* command) { return edit_distance(words[0], command->get_name()); };
  const auto nearest = has_word ? std::ranges::min_element(commands, {}, typos) : commands.end();
  if (nearest != commands.end() && typos(*nearest) <= kMaxTypos) {
    words[0] = (*nearest)->get_name();
  } else {
    const bool has_option =
        std::ranges::any_of(words, [](const std::string& word) { return word.starts_with("--") && word != "--"; });
    const auto fits = [&](CLI::App* command) { return has_option && has_options(*command, words); };
    if (std::ranges::count_if(commands, fits) != 1) return "";
    words.insert(words.begin(), (*std::ranges::find_if(commands, fits))->get_name());
  }
  std::string line;
  for (const std::string& word : words)
    line += " " + (word.find_first_of(" \t\n'\"$&;|<>()*?") == std::string::npos ? word : "'" + word + "'");
  return line;
}

// Explains a command line that lacks a command of `parser` or of one of its commands. Returns "" for other errors. If
// the command is optional, it is missing if there are unknown arguments (`has_extras`) and a similar command knows
// them.
std::string explain_missing_command(CLI::App& parser, int argc, char** argv, bool has_extras) {
  CLI::App* app = &parser;
  std::string name = parser.get_name();
  std::vector<std::string> words(argv + std::min(argc, 1), argv + argc);
  while (!app->get_subcommands().empty()) {
    app = app->get_subcommands().back();
    name += " " + app->get_name();
    if (!words.empty()) words.erase(words.begin());
  }
  const bool is_optional = app->get_require_subcommand_min() == 0;
  if (is_optional && !has_extras) return "";
  std::vector<CLI::App*> commands = app->get_subcommands({});
  std::erase_if(commands, [](CLI::App* command) { return command->get_name().empty(); });  // groups of options
  std::string names;
  for (size_t i = 0; i < commands.size(); i++)
    names += (i == 0 ? "" : i + 1 < commands.size() ? ", " : " or ") + commands[i]->get_name();
  const std::string line = likely_line(commands, words);
  if (is_optional && line.empty()) return "";
  return name + ": needs one of the commands " + names +
         (line.empty() ? "" : "; did you mean \"" + name + line + "\"?") + " (see " + name + " --help)";
}

}  // namespace

int run_tool(App& app, int argc, char** argv, const std::function<void()>& job,
             const std::function<void(const std::string&)>& on_error) {
  CLI::App& parser = *app.parts_->app;
  parser.set_version_flag("--version", parser.get_name() + " " LF_VERSION)->description("Print the version and exit");
  try {
    parser.parse(argc, argv);
    if (job) job();
    return *app.parts_->status;
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return parser.exit(e);
    const bool has_extras = dynamic_cast<const CLI::ExtrasError*>(&e) != nullptr;
    if (const std::string missing = explain_missing_command(parser, argc, argv, has_extras); !missing.empty()) {
      terminal::print_error("%s\n", printable(missing).c_str());
    } else {
      terminal::print_error("%s: %s (see --help)\n", parser.get_name().c_str(), printable(e.what()).c_str());
    }
  } catch (const std::exception& e) {
    const std::string what = printable(e.what());
    terminal::print_error("%s: %s\n", parser.get_name().c_str(), what.c_str());
    if (on_error) on_error(what);
  }
  const auto used = std::ranges::find_if(app.parts_->commands, [](const auto& command) { return bool(*command); });
  return used == app.parts_->commands.end() ? 1 : (*used)->parts_->error_status;
}

template Option* App::add_option(const std::string&, bool&, const std::string&);
template Option* App::add_option(const std::string&, double&, const std::string&);
template Option* App::add_option(const std::string&, float&, const std::string&);
template Option* App::add_option(const std::string&, int&, const std::string&);
template Option* App::add_option(const std::string&, uint16_t&, const std::string&);
template Option* App::add_option(const std::string&, uint32_t&, const std::string&);
template Option* App::add_option(const std::string&, uint64_t&, const std::string&);
template Option* App::add_option(const std::string&, std::string&, const std::string&);
template Option* App::add_option(const std::string&, std::optional<int>&, const std::string&);
template Option* App::add_option(const std::string&, std::optional<double>&, const std::string&);
template Option* App::add_option(const std::string&, std::vector<double>&, const std::string&);
template Option* App::add_option(const std::string&, std::vector<int>&, const std::string&);
template Option* App::add_option(const std::string&, std::vector<std::string>&, const std::string&);

}  // namespace cli
