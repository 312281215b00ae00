// SPDX-License-Identifier: LGPL-2.1-or-later
// lf-calibrate all: recordings of an afternoon become a calibrated rig and a report, one step after the other.
#include <gst/gst.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_value.h"
#include "base/number_text.h"
#include "cameras/doctor.h"
#include "cameras/guided_recording.h"
#include "cameras/rig_cameras.h"
#include "commands.h"
#include "recordings.h"
#include "report_data.h"
#include "report_page.h"
#include "report_verdict.h"
#include "rig/rig_json.h"
#include "steps.h"

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

struct AllArguments {
  std::string rig, lights, boards, colour, out, board, charuco;
  double bar = 0, record = 0;
  bool trusted = false;
  int page = -1;
};

class Afternoon {
 public:
  explicit Afternoon(const AllArguments& o)
      : o_(o),
        out_(o.out.empty() ? (fs::path(o.rig).parent_path() / "calibrated.json").string() : o.out),
        folder_(fs::path(out_).replace_extension().string()),
        steps_(folder_) {
    if (fs::exists(out_) && fs::equivalent(o.rig, out_))
      throw lf::Error(out_ + ": is the rig that the calibration begins with: give another file as --out");
    if (o.record == 0) {
      check_folder(o.lights);
      check_folder(o.boards);
    }
    if (!o.boards.empty() && o.board.empty())
      throw lf::Error("--boards: give --board, the inner corners of the board, as 9x6");
  }

  int run() {
    if (o_.record > 0) {
      record(o_.lights,
             o_.bar > 0 ? "Make the room dark, switch on both lights of the bar"
                        : "Make the room dark, switch on the light",
             "move it near and far and into all corners of the pictures", {.lights = o_.bar > 0 ? 2 : 1});
      if (!o_.boards.empty())
        record(o_.boards, ("Light the room evenly, take the board of " + o_.board + " inner corners").c_str(),
               "hold it where you are told to", {.prompts = lf::cameras::board_prompts()});
      if (!o_.colour.empty())
        record(o_.colour, "Light the room evenly, take the chart",
               "hold it before the cameras, still for a moment, at a dozen places", {});
    }
    std::optional<std::string> rig = geometry();
    if (rig && !o_.colour.empty()) rig = colour(*rig);
    if (rig) publish(*rig);
    return report(rig.has_value());
  }

 private:
  // Asks for what is to be recorded, and records it; what is there already may stay.
  void record(const std::string& folder, const char* before, const char* meanwhile,
              const lf::cameras::RecordingGuide& guide) const {
    const auto ask = [](const std::string& question) {
      std::printf("%s ", question.c_str());
      std::fflush(stdout);
      std::string answer;
      if (!std::getline(std::cin, answer)) throw lf::Error("--record: nobody answers; without it recordings are read");
      return answer;
    };
    if (fs::is_directory(folder) && !fs::is_empty(folder) &&
        ask(folder + " has recordings. Enter: they are used; n and Enter: they are made anew.") != "n")
      return;
    const std::string seconds = lf::number_text(o_.record);
    ask(std::string(before) + ". Enter: the cameras are opened, and record for " + seconds + " s, while you " +
        meanwhile + ".");
    gst_init(nullptr, nullptr);
    lf::cameras::RecordingGuide guided = guide;
    if (o_.page >= 0) guided.page = o_.page;
    const auto rig = std::make_shared<const lf::Rig>(lf::load_rig(o_.rig));
    const std::vector<lf::cameras::Recorded> recorded = lf::cameras::record_guided(
        rig, o_.rig, folder, {.trusted = o_.trusted, .seconds = o_.record}, guided, [] { return true; });
    for (const lf::cameras::Recorded& one : recorded) {
      const lf::Camera& camera = rig->cameras[one.camera];
      const std::string name = lf::cameras::name_of(camera);
      if (!one.problem.empty())
        std::printf("record      camera %s: %s: %s\n", name.c_str(), one.problem.c_str(),
                    lf::cameras::remedy_of(camera, one.problem).c_str());
      if (!one.note.empty()) std::printf("record      camera %s: %s\n", name.c_str(), one.note.c_str());
    }
  }

  std::string file(const char* name) const { return folder_ + "/" + name; }

  // The lenses that boards tell, in a rig file; the rig itself where there are none.
  std::string lenses() {
    if (o_.boards.empty()) return o_.rig;
    gst_init(nullptr, nullptr);
    const lf::Rig rig = lf::load_rig(o_.rig);
    json text = lf::parse_json(lf::read_text_file(o_.rig), o_.rig);
    size_t measured = 0;
    for (size_t i = 0; i < rig.cameras.size(); i++) {
      const lf::Camera& camera = rig.cameras[i];
      const std::vector<std::string> pictures = boards_in(o_.boards, camera);
      if (pictures.empty()) {
        std::printf(
            "boards      camera %u (%s): %s has neither %s.* nor pictures in %s/: its lens is left to the lights\n",
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
    lf::relocate(with_lenses, folder_);
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

  // What is without is still better than nothing.
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

  // A rig file that says the same is left as it is: whoever watches it need not read it again.
  static void write_if_other(const lf::Rig& rig, const std::string& path, const json& text) {
    if (!fs::exists(path) || lf::read_text_file(path) != lf::rig_to_json(rig, &text)) lf::save_rig(rig, path, &text);
  }

  void publish(const std::string& path) {
    lf::Rig rig = lf::load_rig(path);
    const json text = lf::parse_json(lf::read_text_file(path), path);
    lf::relocate(rig, fs::path(out_).parent_path().string());
    write_if_other(rig, out_, text);
  }

  int report(bool has_rig) {
    ReportData data;
    std::vector<const char*> reports = {"track.json"};
    if (has_rig) reports.push_back("solve.json");
    if (has_rig && !o_.colour.empty() && !colour_failure_) reports.push_back("colour.json");
    for (const char* name : reports)
      if (fs::exists(file(name))) data.add(lf::parse_json(lf::read_text_file(file(name)), file(name)), file(name));
    if (!has_rig) data.findings.push_back({"error", "no-rig", "no rig came of it: " + steps_.failure()});
    if (colour_failure_)
      data.findings.push_back({"warning", "no-colour", "colours are not measured: " + *colour_failure_});
    const ReportVerdict verdict = judge(data);
    const std::string page = file("report.html");
    lf::write_text_file(report_page(data, verdict, fs::path(out_).filename().string()), page);
    std::printf("\n%s\n", verdict.headline.c_str());
    for (const std::string& step : verdict.next) std::printf("- %s\n", step.c_str());
    if (has_rig) std::printf("rig         %s\n", out_.c_str());
    std::printf("report      %s\n", fs::absolute(page).string().c_str());
    return has_rig && verdict.grade != ReportVerdict::Grade::kBad ? 0 : 1;
  }

  const AllArguments& o_;
  const std::string out_, folder_;
  Steps steps_;
  std::optional<std::string> colour_failure_;
};

}  // namespace

void add_all_command(cli::App& app, int& status) {
  const auto o = std::make_shared<AllArguments>();
  cli::App* command =
      app.add_subcommand("all",
                         "The afternoon in one command: lenses, lights, cameras, colours and a report, of recordings "
                         "or live. What is done and "
                         "whose inputs have not changed is not done again. Exit status 0: all cameras are fit for use");
  command->add_option("RIG", o->rig, "Rig file, nominal (lf-rig new); is left as it is")->required();
  command->add_option("--lights", o->lights, "Folder with NAME.* of each camera: a light moved through the dark")
      ->required()
      ->type_name("DIR");
  cli::Option* record = command->add_option(
      "--record", o->record,
      "Record first, so many seconds each, with the cameras of RIG: says when to move the light and where it "
      "was not yet, when to hold the board where, when to show the chart, and writes these folders");
  record->type_name("SECONDS")->check(cli::PositiveNumber);
  command
      ->add_option("--page", o->page,
                   "Port of a page on this machine that shows the cameras as they record, and what is said; 0: any")
      ->check(cli::Range(0, 65535))
      ->needs(record);
  cli::add_trust_option(*command, o->trusted);
  command->add_option("--bar", o->bar, "Two lights were moved, so many metres apart: gives the scale")
      ->check(cli::PositiveNumber);
  cli::Option* boards =
      command
          ->add_option(
              "--boards", o->boards,
              "Folder with NAME.*, videos of a checkerboard, or pictures of it in NAME/, of each camera or some")
          ->type_name("DIR");
  command->add_option("--board", o->board, "Inner corners of the board along x and y")->type_name("CxR")->needs(boards);
  command->add_option("--charuco", o->charuco, "The board has markers of this dictionary")
      ->type_name("5X5_100")
      ->needs(boards);
  command
      ->add_option("--colour", o->colour,
                   "Folder with NAME.* of each camera, or a rig file whose cameras have them: a colour chart, or any "
                   "scene that they all see")
      ->type_name("DIR|RIG");
  command
      ->add_option("--out", o->out,
                   "Rig file to write (default: calibrated.json beside RIG); the folder of that "
                   "name without its ending has the report and all steps")
      ->type_name("RIG");
  command->callback([o, &status] { status = Afternoon(*o).run(); });
}
