// SPDX-License-Identifier: LGPL-2.1-or-later
#include <regex>

#include "support/run_program.h"

namespace lf {
namespace {

std::vector<std::string> in_help(const std::string& help, const std::string& expression) {
  std::vector<std::string> words;
  const std::regex pattern(expression);
  std::istringstream lines(help);
  for (std::string line; std::getline(lines, line);)
    if (std::smatch match; std::regex_search(line, match, pattern)) words.push_back(match[1]);
  return words;
}

std::vector<std::string> commands_in(const std::string& help) {
  const size_t at = help.find("Subcommands:");
  if (at == help.npos) return {""};
  std::vector<std::string> commands = in_help(help.substr(at), "^  ([a-z][a-z-]*) ");
  commands.push_back("");
  return commands;
}

// `check` exits with 1 if cameras have moved, and with 2 on errors.
constexpr std::string_view kCalibrate = "../calib/lf-calibrate";

class CommandLine : public testing::TestWithParam<const char*> {};

// "nan" passes every range check: it is neither smaller nor larger than any number.
TEST_P(CommandLine, RealNumbersAreFinite) {
  int options = 0;
  for (const std::string& command : commands_in(run_program(GetParam(), "--help").output)) {
    const std::string help = run_program(GetParam(), command + " --help").output;
    for (const std::string& option : in_help(help, "^  (?:-[a-z],)?(--[a-z-]+) FLOAT")) {
      options++;
      for (const char* value : {"nan", "-NaN", "inf"}) {
        const Outcome outcome = run_program(GetParam(), command + " " + option + "=" + value);
        EXPECT_EQ(outcome.status, command == "check" && GetParam() == kCalibrate ? 2 : 1)
            << command << " " << option << "=" << value;
        EXPECT_THAT(outcome.output, mentions(value, "finite")) << command << " " << option;
      }
    }
  }
  std::printf("%s: %d options\n", GetParam(), options);
  EXPECT_GT(options, 0);
}

TEST(Programs, HaveAVersion) {
  for (const char* program : {"lf-archive", "lf-bench", "lf-path", "lf-render", "lf-report", "lf-rig", "lf-run",
                              "lf-scene", "lf-serve", "lf-show", kCalibrate.data()}) {
    const Outcome outcome = run_program(program, "--version");
    EXPECT_EQ(outcome.status, 0) << program;
    EXPECT_THAT(outcome.output, testing::MatchesRegex("lf-[a-z]+ [0-9]+\\.[0-9]+\\.[0-9]+\n"));
  }
}

INSTANTIATE_TEST_SUITE_P(Programs, CommandLine,
                         testing::Values("lf-bench", "lf-path", "lf-render", "lf-rig", "lf-scene", "lf-serve",
                                         "lf-show", kCalibrate.data()),
                         [](const auto& info) {
                           std::string name = info.param;
                           name = name.substr(name.rfind("lf-") + 3);
                           return name;
                         });

}  // namespace
}  // namespace lf
