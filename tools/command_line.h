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

// The part of CLI11 that our programs use, under its names and compiled once. CLI11 is header-only, and each file that
// includes it compiles several seconds longer. Not thread-safe.
namespace cli {

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

// An option, owned by its command. The setters return `this`.
class Option {
 public:
  explicit Option(CLI::Option* option) : option_(option) {}

  Option* required();
  Option* capture_default_str();  // --help shows the variable's current value
  Option* type_name(const std::string& name);
  Option* check(const Check& check);
  Option* delimiter(char between);  // separator between the values of a vector given as one word
  Option* needs(const Option* other);
  Option* excludes(const Option* other);
  explicit operator bool() const;  // true if the option is on the command line; valid after parsing

 private:
  CLI::Option* option_;
};

class App;
void add_trust_option(App& app, bool& trusted);

class App {
 public:
  App(const std::string& description, const std::string& name);
  ~App();

  // `variable` is written during parsing and must outlive this object. Supported types are listed at the end of
  // command_line.cc. The returned option is owned by this object.
  template <class Value>
  Option* add_option(const std::string& name, Value& variable, const std::string& help = "");
  Option* add_flag(const std::string& name, bool& variable, const std::string& help = "");
  App* add_subcommand(const std::string& name, const std::string& help);
  App* add_option_group(const std::string& name);
  App* get_subcommand(const std::string& name);  // the command must exist
  // Rejects command lines that contain this command and an option of `other`, which this command does not use.
  App* excludes_options_of(const App& other);

  App* require_subcommand(size_t count);
  App* require_subcommand(size_t least, size_t most);
  App* require_option(size_t count);
  // Sets a function that is called after parsing if this command is on the command line.
  void callback(std::function<void()> job);
  explicit operator bool() const;

 private:
  friend int run_tool(App& app, int argc, char** argv, const std::function<void()>& job,
                      const std::function<void(const std::string&)>& on_error);
  struct Parts;
  explicit App(std::shared_ptr<CLI::App> app);

  std::unique_ptr<Parts> parts_;
};

// The main() of a tool: parses the command line into the options of `app`, then calls `job`. Prints errors as one line
// on standard error and returns exit status 1. `on_error` also receives errors of `job`.
int run_tool(App& app, int argc, char** argv, const std::function<void()>& job,
             const std::function<void(const std::string&)>& on_error = {});

}  // namespace cli
