// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

// The steps of an afternoon, each a command of lf-calibrate that runs by itself. What a step was made of is kept beside
// what it wrote: as long as that is the same, and its files are there, it is not done again.
class Steps {
 public:
  // `folder`: for steps.json and the steps' own words, STEP.log. Throws lf::Error where it can't be made.
  explicit Steps(const std::string& folder);

  struct Step {
    std::string name;                    // name of the step for people and of its log
    std::vector<std::string> arguments;  // of lf-calibrate
    std::vector<std::string> inputs;     // files and folders that it reads, all that is in these
    std::vector<std::string> outputs;    // files; the first is what the step is for
  };
  // Runs the step unless there is nothing to do, and prints a line of what came of it. False where it failed and left
  // nothing to go on with: its error is on standard error then, and in failure().
  bool run(const Step& step);
  const std::string& failure() const { return failure_; }

 private:
  std::string failure_;  // of the last step that failed
  std::string folder_;
};
