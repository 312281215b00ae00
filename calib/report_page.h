// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>

#include "report_data.h"
#include "report_verdict.h"

// A page of HTML that needs no other file: what a calibration is worth, and what to do next. `title`: what was
// calibrated, in the words of its owner.
std::string report_page(const ReportData& data, const ReportVerdict& verdict, const std::string& title);
