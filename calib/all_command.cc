// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-calibrate all: runs all calibration steps on recordings and writes a calibrated rig and a report.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <gio/gio.h>
#include <gst/gst.h>
#include <sys/stat.h>
#include <nlohmann/json.hpp>

#include "base/file.h"
#include "base/json_value.h"
#include "base/text.h"
#include "cameras/doctor.h"
#include "cameras/guided_recording.h"
#include "cameras/rig_cameras.h"
#include "commands.h"
#include "recordings.h"
#include "report_data.h"
#include "report_page.h"
#include "rig/rig_json.h"
#include "terminal.h"

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// Identifies the version of a file by its size and modification time.
json mark_of(const fs::path& path) {
  struct stat s = {};
  if (stat(path.c_str(), &s) != 0) return nullptr;
  return {s.st_size, s.st_mtim.tv_sec, s.st_mtim.tv_nsec};
}

json marks_of(const std::vector<std::string>& paths) {
  json marks = json::object();
  for (const std::string& path : paths) {
    if (!fs::is_directory(path)) {
      marks[path] = mark_of(path);
      continue;
    }
    for (const auto& entry : fs::recursive_directory_iterator(path))
      if (entry.is_regular_file()) marks[entry.path().string()] = mark_of(entry.path());
  }
  return marks;
}

// Runs a command with standard output in the file `log`, and returns its exit status. Standard error stays on the
// terminal, for progress bars.
int run_program(const std::vector<std::string>& arguments, const std::string& log) {
  std::vector<const char*> words = {"/proc/self/exe"};
  for (const std::string& argument : arguments) words.push_back(argument.c_str());
  words.push_back(nullptr);
  g_autoptr(GSubprocessLauncher) launcher = g_subprocess_launcher_new(G_SUBPROCESS_FLAGS_STDIN_INHERIT);
  g_subprocess_launcher_set_stdout_file_path(launcher, log.c_str());
  g_autoptr(GError) error = nullptr;
  g_autoptr(GSubprocess) child = g_subprocess_launcher_spawnv(launcher, words.data(), &error);
  if (!child) throw lf::Error(std::string("lf-calibrate cannot be started: ") + error->message);
  g_subprocess_wait(child, nullptr, nullptr);
  if (g_subprocess_get_if_signaled(child))
    throw lf::Error("ended by signal " + std::to_string(g_subprocess_get_term_sig(child)));
  return g_subprocess_get_exit_status(child);
}

std::string last_line(const std::string& text) {
  const size_t end = text.find_last_not_of('\n');
  if (end == std::string::npos) return "";
  const size_t begin = text.rfind('\n', end);
  return text.substr(begin == std::string::npos ? 0 : begin + 1,
                     end - (begin == std::string::npos ? 0 : begin + 1) + 1);
}

// Runs the calibration steps, each as a separate lf-calibrate command. A step is skipped if its inputs, arguments and
// output files have not changed since its last run.
class StepRunner {
 public:
  // `folder` receives steps.json and STEP.log, the output of each step. Throws lf::Error if it cannot be created.
  explicit StepRunner(const std::string& folder) : folder_(folder) { lf::make_folder(folder); }

  struct Step {
    std::string name;
    std::vector<std::string> arguments;
    std::vector<std::string> inputs;  // input files, and folders including their files
    std::vector<std::string> outputs;
  };
  // Runs the step unless it is up to date, and prints the last line of its output. Returns false if the step fails
  // without writing all outputs. The error is then on standard error and in failure().
  bool run(const Step& step) {
    const std::string book = folder_ + "/steps.json", log = folder_ + "/" + step.name + ".log";
    json done = json::object();
    if (fs::exists(book)) try {
        done = json::parse(lf::read_text_file(book));
      } catch (const json::exception&) {
      }
    if (!done.is_object()) done = json::object();
    // All steps run again with a new build of this program.
    std::vector<std::string> inputs = step.inputs;
    inputs.push_back("/proc/self/exe");
    const json made_of = {{"arguments", step.arguments}, {"inputs", marks_of(inputs)}};
    const auto before = done.find(step.name);
    if (before != done.end() && before->is_object() && before->value("made_of", json()) == made_of &&
        before->value("outputs", json()) == marks_of(step.outputs) && before->value("said", json()).is_string()) {
      terminal::print("%-11s as before: %s\n", step.name.c_str(), before->value("said", "").c_str());
      return true;
    }
    std::fflush(stdout);
    done.erase(step.name);
    // Keeps the previous outputs under another name until the new outputs exist, or the step has failed.
    const auto aside = [](const std::string& output) { return output + ".before"; };
    for (const std::string& output : step.outputs)
      if (fs::exists(output)) fs::rename(output, aside(output));
    const int status = run_program(step.arguments, log);
    std::string said = last_line(lf::read_text_file(log));
    constexpr std::string_view kError = "error: ";
    if (status != 0 && said.starts_with(kError)) {
      failure_ = said.substr(kError.size());
      // The error is already on the terminal; the line before it is the result of the step.
      const std::string text = lf::read_text_file(log);
      said = last_line(text.substr(0, text.rfind(kError)));
    }
    const bool left_all = std::ranges::all_of(step.outputs, [](const std::string& path) { return fs::exists(path); });
    terminal::print("%-11s %s%s\n", step.name.c_str(), said.empty() ? "failed" : said.c_str(),
                    status == 0 ? ""
                    : left_all  ? " (with errors)"
                                : "");
    std::fflush(stdout);
    if (!left_all) return false;
    for (const std::string& output : step.outputs) fs::remove(aside(output));
    // If a step fails but writes its outputs, it is done until its inputs change.
    done[step.name] = {{"made_of", made_of}, {"outputs", marks_of(step.outputs)}, {"said", said}};
    lf::write_text_file(done.dump(1) + "\n", book);
    return true;
  }
  const std::string& failure() const { return failure_; }

 private:
  std::string failure_;
  std::string folder_;
};

struct AllArguments {
  std::string rig, lights, boards, colour, out, board, charuco;
  double bar = 0, record = 0;
  bool trusted = false;
  int page = -1;
};

class CalibrationRun {
 public:
  explicit CalibrationRun(const AllArguments& o)
      : o_(o),
        out_(o.out.empty() ? (fs::path(o.rig).parent_path() / "calibrated.json").string() : o.out),
        folder_(fs::path(out_).replace_extension().string()),
        steps_(folder_) {
    if (fs::exists(out_) && fs::equivalent(o.rig, out_))
      throw lf::Error(out_ + ": is the input rig, which must not be overwritten; give another file as --out");
    if (o.record == 0) {
      check_folder(o.lights);
      check_folder(o.boards);
    }
    if (!o.boards.empty() && o.board.empty())
      throw lf::Error("--boards: requires --board, the number of inner corners of the board, such as 9x6");
  }

  int run() {
    if (o_.record > 0) {
      record(o_.lights,
             o_.bar > 0 ? "Make the room dark, switch on both lights of the bar"
                        : "Make the room dark, switch on the light",
             "move it near and far, and into all corners of the images", {.lights = o_.bar > 0 ? 2 : 1});
      if (!o_.boards.empty())
        record(o_.boards, ("Light the room evenly, take the board of " + o_.board + " inner corners").c_str(),
               "follow the prompts", {.prompts = lf::cameras::board_prompts()});
      if (!o_.colour.empty())
        record(o_.colour, "Light the room evenly, take the chart",
               "hold it still in front of the cameras, at a dozen places", {});
    }
    std::optional<std::string> rig = geometry();
    if (rig && !o_.colour.empty()) rig = colour(*rig);
    if (rig) publish(*rig);
    return report(rig.has_value());
  }

 private:
  // Prompts the operator and records, unless the operator reuses existing recordings.
  void record(const std::string& folder, const char* before, const char* meanwhile,
              const lf::cameras::RecordingGuide& guide) const {
    const auto ask = [](const std::string& question) {
      terminal::print("%s ", question.c_str());
      std::fflush(stdout);
      std::string answer;
      if (!std::getline(std::cin, answer))
        throw lf::Error(
            "--record: there is no answer on standard input, but recording needs an operator; omit --record to use "
            "existing recordings");
      return answer;
    };
    if (fs::is_directory(folder) && !fs::is_empty(folder) &&
        ask(folder + " already contains recordings. Press Enter to use them, or n and Enter to record again.") != "n")
      return;
    const std::string seconds = lf::number_text(o_.record);
    ask(std::string(before) + ". Then press Enter: the cameras record for " + seconds + " seconds. Meanwhile, " +
        meanwhile + ".");
    gst_init(nullptr, nullptr);
    lf::cameras::RecordingGuide guided = guide;
    if (o_.page >= 0) guided.page = o_.page;
    const auto rig = std::make_shared<const lf::Rig>(lf::load_rig(o_.rig));
    const std::vector<lf::cameras::RecordedCamera> recorded = lf::cameras::record_guided(
        rig, o_.rig, folder, {.trusted = o_.trusted, .seconds = o_.record}, guided, [] { return true; });
    for (const lf::cameras::RecordedCamera& one : recorded) {
      const lf::Camera& camera = rig->cameras[one.camera];
      const std::string name = camera.label();
      if (!one.problem.empty())
        terminal::print("record      %s: %s: %s\n", name.c_str(), one.problem.c_str(),
                        lf::cameras::remedy_for(camera, one.problem).c_str());
      if (!one.note.empty()) terminal::print("record      %s: %s\n", name.c_str(), one.note.c_str());
    }
  }

  std::string file(const char* name) const { return folder_ + "/" + name; }

  // Calibrates the lenses from images of the board. Returns a rig file with these lenses, or the input rig if there are
  // no images.
  std::string lenses() {
    if (o_.boards.empty()) return o_.rig;
    gst_init(nullptr, nullptr);
    const lf::Rig rig = lf::load_rig(o_.rig);
    json text = lf::parse_json(lf::read_text_file(o_.rig), o_.rig);
    size_t measured = 0;
    for (size_t i = 0; i < rig.cameras.size(); i++) {
      const lf::Camera& camera = rig.cameras[i];
      const std::vector<std::string> pictures = board_images(o_.boards, camera);
      if (pictures.empty()) {
        terminal::print(
            "boards      camera %u (%s): %s contains neither a video %s.* nor images in %s/, so the lights determine "
            "its lens\n",
            camera.id, camera.name.c_str(), o_.boards.c_str(), camera.name.c_str(), camera.name.c_str());
        continue;
      }
      const std::string name = "boards-" + std::to_string(camera.id), out = folder_ + "/" + name + ".json";
      std::vector<std::string> words = {"intrinsics"};
      std::vector<std::string> inputs = {o_.rig};
      for (const std::string& picture : pictures) {
        words.push_back(picture);
        inputs.push_back(picture.starts_with("file://") ? picture.substr(7) : picture);
      }
      for (const std::string& word : {std::string("--rig"), o_.rig, std::string("--camera"), std::to_string(camera.id),
                                      std::string("--board"), o_.board, std::string("--out"), out})
        words.push_back(word);
      if (!o_.charuco.empty()) words.insert(words.end(), {"--charuco", o_.charuco});
      if (!steps_.run({name, words, inputs, {out}})) continue;
      const json found = lf::parse_json(lf::read_text_file(out), out);
      for (const char* key : {"model", "params", "covariance"}) text["cameras"][i][key] = found["cameras"][i][key];
      measured++;
    }
    if (measured == 0) return o_.rig;
    lf::Rig with_lenses = lf::parse_rig(text.dump(), o_.rig);
    with_lenses.directory = rig.directory;
    lf::rebase_paths(with_lenses, folder_);
    write_if_other(with_lenses, file("lenses.json"), text);
    return file("lenses.json");
  }

  std::optional<std::string> geometry() {
    const std::string prior = lenses();
    std::vector<std::string> track = {
        "track", o_.rig, "--recordings", o_.lights, "--out", file("tracks.json"), "--json", file("track.json")};
    if (o_.bar > 0) track.push_back("--bar");
    if (!steps_.run({"track", track, {o_.rig, o_.lights}, {file("tracks.json"), file("track.json")}}))
      return std::nullopt;
    std::vector<std::string> solve = {
        "solve",  "--tracks",        file("tracks.json"), "--prior", prior, "--out", file("geometry.json"),
        "--json", file("solve.json")};
    if (o_.bar > 0) solve.insert(solve.end(), {"--bar", lf::number_text(o_.bar)});
    if (!steps_.run({"solve", solve, {file("tracks.json"), prior}, {file("geometry.json"), file("solve.json")}}))
      return std::nullopt;
    return file("geometry.json");
  }

  // A rig without colour corrections is still useful.
  std::string colour(const std::string& rig) {
    const std::string coloured = file("coloured.json");
    const bool done =
        steps_.run({"colour",
                    {"colour", rig, "--recording", o_.colour, "--out", coloured, "--json", file("colour.json")},
                    {rig, o_.colour},
                    {coloured, file("colour.json")}});
    if (!done) colour_failure_ = steps_.failure();
    return done ? coloured : rig;
  }

  // An unchanged rig file stays untouched, so that programs that watch the file do not reload the rig.
  static void write_if_other(const lf::Rig& rig, const std::string& path, const json& text) {
    if (!fs::exists(path) || lf::read_text_file(path) != lf::rig_to_json(rig, &text)) lf::save_rig(rig, path, &text);
  }

  void publish(const std::string& path) {
    lf::Rig rig = lf::load_rig(path);
    const json text = lf::parse_json(lf::read_text_file(path), path);
    lf::rebase_paths(rig, fs::path(out_).parent_path().string());
    write_if_other(rig, out_, text);
  }

  int report(bool has_rig) {
    ReportData data;
    std::vector<const char*> reports = {"track.json"};
    if (has_rig) reports.push_back("solve.json");
    if (has_rig && !o_.colour.empty() && !colour_failure_) reports.push_back("colour.json");
    for (const char* name : reports)
      if (fs::exists(file(name))) data.add(lf::parse_json(lf::read_text_file(file(name)), file(name)), file(name));
    if (!has_rig) data.findings.push_back({"error", "no-rig", "no rig was written: " + steps_.failure()});
    if (colour_failure_)
      data.findings.push_back({"warning", "no-colour", "colours are not measured: " + *colour_failure_});
    const ReportVerdict verdict = grade_calibration(data);
    const std::string page = file("report.html");
    lf::write_text_file(report_page(data, verdict, fs::path(out_).filename().string()), page);
    terminal::print("\n%s\n", verdict.headline.c_str());
    for (const std::string& step : verdict.next) terminal::print("- %s\n", step.c_str());
    if (has_rig) terminal::print("rig         %s\n", out_.c_str());
    terminal::print("report      %s\n", fs::absolute(page).string().c_str());
    return has_rig && verdict.grade != ReportVerdict::Grade::kBad ? 0 : 1;
  }

  const AllArguments& o_;
  const std::string out_, folder_;
  StepRunner steps_;
  std::optional<std::string> colour_failure_;
};

}  // namespace

void add_all_command(cli::App& app) {
  const auto o = std::make_shared<AllArguments>();
  cli::App* command = app.add_subcommand(
      "all",
      "Runs all calibration steps on recordings or live cameras: lenses from board images, positions from moving "
      "lights, colours, and a report. Steps with unchanged inputs are skipped, so the command can be repeated. The "
      "exit status is 0 if all cameras are fit for use");
  command
      ->add_option(
          "RIG", o->rig,
          "Rig file with the nominal positions of the cameras, for example from lf-rig new. The file is not modified")
      ->required();
  command
      ->add_option(
          "--lights", o->lights,
          "Folder with a recording NAME.* of each camera. The recordings show a light that moves through the dark")
      ->required()
      ->type_name("DIR");
  cli::Option* record = command->add_option(
      "--record", o->record,
      "Record with the cameras of RIG first, for this many seconds per recording. The command prompts for the light, "
      "the board and the chart, and reports image regions that they have not reached");
  record->type_name("SECONDS")->check(cli::PositiveNumber);
  command
      ->add_option("--page", o->page,
                   "TCP port of a local web page that shows live images and prompts during the recording (0: the "
                   "system selects a free port)")
      ->check(cli::Range(0, 65535))
      ->needs(record);
  cli::add_trust_option(*command, o->trusted);
  command
      ->add_option("--bar", o->bar,
                   "Distance between two lights on a bar, in metres. It determines the scale of the rig")
      ->check(cli::PositiveNumber);
  cli::Option* boards =
      command
          ->add_option("--boards", o->boards,
                       "Folder with images of a checkerboard for some or all cameras: either a video NAME.*, or stills "
                       "in a subfolder NAME/. Lenses of cameras without such images are determined from the lights")
          ->type_name("DIR");
  command
      ->add_option("--board", o->board,
                   "Number of inner corners of the board along x and y, for example 9x6. Inner corners are points "
                   "where four squares meet")
      ->type_name("CxR")
      ->needs(boards);
  command
      ->add_option("--charuco", o->charuco,
                   "ArUco dictionary of the markers on a ChArUco board, for example 5X5_100. Without this option, the "
                   "board is a plain checkerboard")
      ->type_name("5X5_100")
      ->needs(boards);
  command
      ->add_option("--colour", o->colour,
                   "Recordings for the colour calibration. They show a colour chart, or a scene that all cameras see. "
                   "Give a folder with NAME.* for each camera, or a rig file with sources or images")
      ->type_name("DIR|RIG");
  command
      ->add_option("--out", o->out,
                   "Calibrated rig file to write (default: calibrated.json in the folder of RIG). The report and "
                   "intermediate files are written to a folder with the same name without extension")
      ->type_name("RIG");
  command->callback([o] { return CalibrationRun(*o).run(); });
}
