// SPDX-License-Identifier: LGPL-2.1-or-later
// bench-render: speed against error of every way to render a view, beside OpenCV.
#include <cstdio>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/json_value.h"
#include "bench/render/acceptance.h"
#include "bench/render/access.h"
#include "bench/render/budget.h"
#include "bench/render/numerics.h"
#include "bench/render/once.h"
#include "bench/render/plan.h"
#include "bench/render/plots.h"
#include "command_line.h"
#include "progress.h"

namespace {

struct Options {
  lf::bench::PlanOptions plan;
  std::vector<std::string> sizes;
  std::string json, plots;
  std::string method, size = "320x240";
  int cameras = 16, times = 1;
};

std::pair<int, int> size_of(const std::string& option, const std::string& text) {
  int width, height, end = 0;
  if (std::sscanf(text.c_str(), "%dx%d%n", &width, &height, &end) != 2 || text[end] != 0 || width < 16 || height < 16 ||
      width > lf::kMaxImageSize || height > lf::kMaxImageSize)
    throw lf::Error(option + " " + text + ": must be WIDTHxHEIGHT, 16 to 16384 pixels each");
  return {width, height};
}

std::vector<std::pair<int, int>> sizes_of(const Options& options) {
  std::vector<std::pair<int, int>> sizes;
  for (const std::string& size : options.sizes) sizes.push_back(size_of("--sizes", size));
  return sizes.empty() ? options.plan.sizes : sizes;
}

void run(Options options) {
  options.plan.sizes = sizes_of(options);
  if (!options.plots.empty()) lf::bench::require_gnuplot();
  const std::vector<lf::bench::Configuration> plan = lf::bench::make_plan(options.plan);
  std::vector<lf::bench::Row> rows;
  Progress progress("measuring", plan.size());
  for (const lf::bench::Configuration& configuration : plan) {
    const lf::bench::Scene scene(configuration.scene);
    const std::vector<lf::bench::Row> some =
        measure(scene, lf::bench::methods(configuration.methods), configuration.timing);
    progress.finish();
    print_table(some);
    rows.insert(rows.end(), some.begin(), some.end());
    progress.step();
  }
  progress.finish();
  print_pareto(rows);
  if (options.plan.full || options.plan.acceptance) print_acceptance(rows);
  if (!options.json.empty()) lf::write_text_file(to_json(rows), options.json);
  if (!options.plots.empty()) lf::bench::write_plots(rows, options.plots);
}

}  // namespace

int main(int argc, char** argv) {
  Options o;
  cli::App app(
      "Measures every way to render views of an array: time, bytes and error, beside OpenCV. Without options: 64 "
      "cameras, one thread, four sizes, within 5 minutes.",
      "bench-render");
  app.add_flag("--full", o.plan.full, "everything: 4 to 1024 cameras, qualities, threads, pixel families, views");
  app.add_flag("--acceptance", o.plan.acceptance, "what is promised, beside the goals");
  app.add_option("--sizes", o.sizes, "of views and cameras: 640x480,1920x1080")->delimiter(',')->type_name("WxH,...");
  app.add_option("--cameras", o.plan.cameras, "64 without this")->delimiter(',')->check(cli::Range(4, 4096));
  app.add_option("--threads", o.plan.threads)->delimiter(',')->check(cli::Range(1, 256));
  app.add_option("--qualities", o.plan.qualities, "of JPEG")->delimiter(',')->check(cli::Range(1, 100));
  app.add_option("--repeats", o.plan.repeats, "turns of each method, in place of a few seconds each situation")
      ->check(cli::Range(1, 1000000));
  app.add_option("--json", o.json, "write the rows to this file")->type_name("FILE");
  app.add_option("--plots", o.plots, "draw them into this folder (needs gnuplot)")->type_name("DIR");
  app.require_subcommand(0, 1);
  const cli::App* numerics =
      app.add_subcommand("numerics", "errors of every renderer in the hard cases, against 80-bit reals");
  const cli::App* budget = app.add_subcommand("budget", "what each step of rendering adds to the error");
  const cli::App* access = app.add_subcommand(
      "access", "cameras that find out, that are told how to warp, that give pixels: bytes and time");
  cli::App* once = app.add_subcommand("once", "renders one view once: what tests/bench/instructions.sh counts");
  once->add_option("METHOD", o.method, "as in the table: \"simd i420\"")->required();
  once->add_option("--size", o.size, "of the view")->capture_default_str()->type_name("WxH");
  once->add_option("--cameras", o.cameras)->capture_default_str()->check(cli::Range(4, 4096));
  once->add_option("--times", o.times, "not once: for profilers that take samples")
      ->capture_default_str()
      ->check(cli::Range(1, 1000000));
  return cli::run_tool(app, argc, argv, [&] {
    const auto require = [](bool within) {
      if (!within) throw lf::Error("an error is beyond its bound");
    };
    if (*numerics) {
      require(lf::bench::print_numerics());
    } else if (*budget) {
      require(lf::bench::print_budget());
    } else if (*access) {
      lf::bench::print_access(sizes_of(o), o.plan.cameras.empty() ? 64 : o.plan.cameras.front(), o.plan.repeats);
    } else if (*once) {
      const auto [width, height] = size_of("--size", o.size);
      lf::bench::run_once(o.method, {o.cameras, width, height}, o.times);
    } else {
      run(o);
    }
  });
}
