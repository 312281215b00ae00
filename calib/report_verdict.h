// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "report_data.h"

// What a calibration is worth, camera by camera, and what to do next.
struct ReportVerdict {
  enum class Grade { kGood, kFair, kBad };
  struct Camera {
    Grade grade = Grade::kGood;
    std::vector<std::string> reasons;  // worst first; none for a good one
  };
  Grade grade = Grade::kGood;     // grade of the whole calibration
  std::string headline;           // the verdict in one line
  std::vector<Camera> cameras;    // one for each camera of the data
  std::vector<std::string> next;  // what to do, most needed first
};

ReportVerdict judge(const ReportData& data);

const char* name_of(ReportVerdict::Grade grade);  // "good", "fair", "bad"
