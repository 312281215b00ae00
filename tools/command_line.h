// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <functional>
#include <initializer_list>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>

namespace CLI {
class App;
class Option;
class Validator;
}  // namespace CLI

// The part of the command line parser CLI11 that our programs use. CLI11 is header-only and takes several seconds to
// compile, so only command_line.cc includes its headers. Not thread-safe.
namespace cli {

// A test for the value of an option, for example Range(1, 100). A value that fails is an error of the user.
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

// An option of a command, owned by the command. All setters return `this`, so that calls can be chained.
class Option {
 public:
  explicit Option(CLI::Option* option) : option_(option) {}

  Option* required();
  Option* capture_default_str();  // for a default that is 0, see App::add_option()
  Option* type_name(const std::string& name);
  Option* check(const Check& check);
  Option* delimiter(char between);  // lets one argument contain several values for a vector, such as "1,2,3"
  Option* needs(const Option* other);
  Option* excludes(const Option* other);
  explicit operator bool() const;  // After parsing: true if the command line contains the option.

 private:
  CLI::Option* option_;
};

class App;
void add_trust_option(App& app, bool& trusted);

class App {
 public:
  App(const std::string& description, const std::string& name);
  ~App();

  // Adds an option or a positional argument. Parsing writes its value to `variable`, which must outlive this object.
  // The end of command_line.cc lists the supported types. Unless the option is required, --help shows a positive number
  // or a text in `variable` as the default. This object owns the returned option.
  template <class Value>
  Option* add_option(const std::string& name, Value& variable, const std::string& help = "");
  Option* add_flag(const std::string& name, bool& variable, const std::string& help = "");
  App* add_subcommand(const std::string& name, const std::string& help);
  App* add_option_group(const std::string& name);
  // Rejects command lines that combine this subcommand with an option of `other`. Use this for options of the program
  // itself that the subcommand ignores.
  App* excludes_options_of(const App& other);

  App* require_subcommand(size_t count);
  App* require_subcommand(size_t least, size_t most);
  App* require_option(size_t count);
  // Sets the function of a command. If it returns a number, this is the exit status of the program.
  template <class Job>
  void callback(Job job) {
    set_callback([job = std::move(job)] {
      if constexpr (std::is_void_v<decltype(job())>)
        return job(), 0;
      else
        return job();
    });
  }
  void set_error_status(int status);  // exit status of the program after an error of this command; 1 by default
  explicit operator bool() const;

 private:
  friend int run_tool(App& app, int argc, char** argv, const std::function<void()>& job,
                      const std::function<void(const std::string&)>& on_error);
  struct Parts;
  App(std::shared_ptr<CLI::App> app, std::shared_ptr<int> status);
  void set_callback(std::function<int()> job);

  std::unique_ptr<Parts> parts_;
};

// Implements main() for a tool. Parses the command line into the options of `app`, and calls the functions of the
// commands, then `job`, if given. An lf::Error is printed as one line on standard error and passed to `on_error`.
// Returns the exit status.
int run_tool(App& app, int argc, char** argv, const std::function<void()>& job = {},
             const std::function<void(const std::string&)>& on_error = {});

}  // namespace cli
