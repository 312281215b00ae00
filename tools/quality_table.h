// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "quality/quality.h"

// One view: a line of the table and an entry of the JSON file.
struct QualityRow {
  std::string name;
  std::optional<lf::Quality> quality;  // against ground truth; nothing where there is none
  double coverage = 0;                 // fraction of the pixels that count
  double cameras = 0;                  // cameras that contributed
  double ms = 0;
};

// Prints the rows and their mean, over the views in which something is covered.
void print_table(const std::vector<QualityRow>& rows);

// {"views": [{"name", "psnr_db", "ssim", "max_error", "coverage", "cameras", "ms"}, ...], "mean": {...}}. JSON has no
// infinity: equal pictures (max_error 0) and views without truth have null. Throws lf::Error naming the file.
void write_json(const std::vector<QualityRow>& rows, const std::string& path);
