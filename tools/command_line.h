// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <initializer_list>
#include <memory>
#include <string>

namespace CLI {
class App;
class Option;
class Validator;
}  // namespace CLI

// The part of CLI11 that our programs use, under its names and compiled once: CLI11 is all headers, and each main()
// that includes it costs several seconds of compiling. Nothing here is safe for several threads.
namespace cli {

// These check a value and say what it must be.
class Check {
 public:
  explicit Check(const CLI::Validator& validator);
  const CLI::Validator& validator() const { return *validator_; }

 private:
  std::shared_ptr<const CLI::Validator> validator_;
};
Check Range(int least, int most);
Check Range(double least, double most);
Check IsMember(std::initializer_list<const char*> texts);
Check IsMember(std::initializer_list<int> numbers);
extern const Check PositiveNumber, NonNegativeNumber, ExistingPath;

// An option of a command, which owns it. All functions return the option itself.
class Option {
 public:
  explicit Option(CLI::Option* option) : option_(option) {}

  Option* required();
  Option* capture_default_str();  // --help shows what the variable holds now
  Option* type_name(const std::string& name);
  Option* check(const Check& check);
  Option* delimiter(char between);  // the character between values of a vector that come as one word
  Option* needs(const Option* other);
  Option* excludes(const Option* other);
  explicit operator bool() const;  // whether the option is on the command line; valid once that is parsed

 private:
  CLI::Option* option_;
};

class App;
// Adds --trust-rig, which sets `trusted` (rig/source_security.h).
void add_trust_option(App& app, bool& trusted);

// A program's command line, one of its commands, or a group of options.
class App {
 public:
  App(const std::string& description, const std::string& name);
  ~App();

  // `variable` is written while the command line is parsed and must outlive this. Values: the types at the end of
  // command_line.cc. Returns what this owns.
  template <class Value>
  Option* add_option(const std::string& name, Value& variable, const std::string& help = "");
  Option* add_flag(const std::string& name, bool& variable, const std::string& help = "");
  App* add_subcommand(const std::string& name, const std::string& help);
  App* add_option_group(const std::string& name);
  App* get_subcommand(const std::string& name);  // a command that was added before
  // Refuses command lines with this command and an option of `other`, which has no meaning for this command.
  App* excludes_options_of(const App& other);

  App* require_subcommand(size_t count);
  App* require_subcommand(size_t least, size_t most);
  App* require_option(size_t count);
  // Sets what is called where this command is on the command line, once all of it is parsed.
  void callback(std::function<void()> job);
  explicit operator bool() const;  // whether this command is on the command line

 private:
  friend int run_tool(App& app, int argc, char** argv, const std::function<void()>& job,
                      const std::function<void(const std::string&)>& on_error);
  struct Parts;
  explicit App(std::shared_ptr<CLI::App> app);

  std::unique_ptr<Parts> parts_;
};

// The main() of a tool: parses the command line into `app`'s options, then calls `job`. What goes wrong is one line on
// standard error and exit status 1; `on_error` is told, too.
int run_tool(App& app, int argc, char** argv, const std::function<void()>& job,
             const std::function<void(const std::string&)>& on_error = {});

}  // namespace cli
