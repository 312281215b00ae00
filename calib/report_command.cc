// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-calibrate report: what the steps said, on one page.
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/json_value.h"
#include "commands.h"
#include "report_data.h"
#include "report_page.h"
#include "report_verdict.h"

namespace {

struct ReportArguments {
  std::vector<std::string> files;
  std::string out = "report.html", title;
};

void write(const ReportArguments& o) {
  ReportData data;
  for (const std::string& file : o.files) data.add(lf::parse_json(lf::read_text_file(file), file), file);
  const ReportVerdict verdict = judge(data);
  const std::string title =
      o.title.empty() ? std::filesystem::absolute(o.files[0]).parent_path().filename().string() : o.title;
  lf::write_text_file(report_page(data, verdict, title), o.out);
  std::printf("%s: %s\n", o.out.c_str(), verdict.headline.c_str());
  for (const std::string& step : verdict.next) std::printf("- %s\n", step.c_str());
}

}  // namespace

void add_report_command(cli::App& app) {
  const auto o = std::make_shared<ReportArguments>();
  cli::App* command = app.add_subcommand(
      "report", "One page of what the steps said: a verdict for each camera, plots, and what to do next");
  command->add_option("FILE", o->files, "What --json of track, solve, colour and check wrote, any of them")->required();
  command->add_option("--out", o->out, "Page to write (HTML); opens from disk, without a network")
      ->capture_default_str();
  command->add_option("--title", o->title, "Of the page (default: the files' folder)");
  command->callback([o] { write(*o); });
}
