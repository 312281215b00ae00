// SPDX-License-Identifier: LGPL-2.1-or-later
// Checks statements of the documents about elements and tools, and runs their launch lines as written.

#include <cctype>
#include <regex>

#include "base/json_value.h"
#include "gst/gst_test.h"
#include "pipelines/gst_launch.h"
#include "support/temp_dir.h"

namespace lf {
namespace {

namespace fs = std::filesystem;
using Names = std::set<std::string>;

const std::string kReadme = "README.md", kEmbedding = "docs/guides/embedding.md";

std::string document(const std::string& name) { return read_text_file(LF_SOURCE_ROOT "/" + name); }

// Returns the text under "## HEADING" up to the next heading of that level.
std::string section(const std::string& name, const std::string& heading) {
  const std::string text = document(name);
  const size_t begin = text.find("\n## " + heading + "\n");
  if (begin == std::string::npos) return "";
  return text.substr(begin + 1, text.find("\n## ", begin + 1) - begin);
}

Names quoted(const std::string& text) {
  const std::regex code("`([^`]*)`");
  Names names;
  for (std::sregex_iterator i(text.begin(), text.end(), code), end; i != end; ++i) names.insert((*i)[1]);
  return names;
}

// Returns the backquoted names in the first column of a table in docs/, under a heading.
Names rows(const std::string& name, const std::string& heading) {
  const std::regex row("^\\|( `[^|]+` )\\|.*$");
  Names names;
  std::istringstream text(section("docs/" + name, heading));
  for (std::string line; std::getline(text, line);)
    if (std::smatch match; std::regex_match(line, match, row)) names.merge(quoted(match[1]));
  return names;
}

// Returns the launch lines of a section, with continuation lines joined.
std::vector<std::string> launch_lines(const std::string& name, const std::string& heading) {
  const std::string text = section(name, heading);
  std::vector<std::string> lines;
  for (size_t at = 0; (at = text.find("\ngst-launch-1.0 ", at)) != std::string::npos;) {
    at += sizeof("\ngst-launch-1.0 ") - 1;
    lines.push_back(std::regex_replace(text.substr(at, text.find("\n```", at) - at), std::regex("\\\\\n"), " "));
  }
  return lines;
}

Names plugin_elements() {
  Names names;
  GList* features = gst_registry_get_feature_list_by_plugin(gst_registry_get(), "lightfield");
  for (GList* i = features; i; i = i->next)
    if (GST_IS_ELEMENT_FACTORY(i->data)) names.insert(GST_OBJECT_NAME(i->data));
  gst_plugin_feature_list_free(features);
  return names;
}

TEST(Readme, ElementTableMatchesThePlugin) { EXPECT_EQ(rows("guides/pipelines.md", "Elements"), plugin_elements()); }

TEST(Readme, ToolTableMatchesTheTools) {
  Names built;
  for (const char* folder : {LF_TOOLS_DIR, LF_TOOLS_DIR "/../calib"})
    for (const fs::directory_entry& entry : fs::directory_iterator(folder))
      if (entry.is_regular_file() && entry.path().filename().string().starts_with("lf-"))
        built.insert(entry.path().filename().string());
  EXPECT_EQ(rows("reference/tools.md", "Overview"), built);
}

TEST(Readme, LinksAreValid) {
  const std::regex link("\\]\\(([^)#:]*)(#[^)]*)?\\)");
  std::vector<fs::path> documents{"README.md", "CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md", "calib/README.md"};
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(LF_SOURCE_ROOT "/docs"))
    if (entry.path().extension() == ".md") documents.push_back(fs::relative(entry.path(), LF_SOURCE_ROOT));
  for (const fs::path& name : documents) {
    const std::string text = document(name);
    for (std::sregex_iterator i(text.begin(), text.end(), link), end; i != end; ++i) {
      const fs::path to = (*i)[1].length() > 0 ? name.parent_path() / (*i)[1].str() : name;
      ASSERT_TRUE(fs::exists(LF_SOURCE_ROOT / to)) << name << ": " << (*i)[0];
      if ((*i)[2].length() == 0) continue;
      std::string headings;  // anchor names as in HTML
      std::istringstream lines(document(to));
      for (std::string line; std::getline(lines, line);)
        if (line.starts_with("#")) {
          std::string anchor;
          for (const char c : line.substr(line.find(' ') + 1))
            if (c == ' ')
              anchor += '-';
            else if (std::isalnum(static_cast<unsigned char>(c)) || c == '-' || c == '_')
              anchor += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
          headings += "#" + anchor + "\n";
        }
      EXPECT_THAT(headings, HasSubstr((*i)[2].str() + "\n")) << name << ": " << (*i)[0];
    }
  }
}

// A folder with a small recording and path, made as in the README; it is the current folder during the object's
// lifetime.
class FilmFolder {
 public:
  FilmFolder() : before_(fs::current_path()) {
    test::expect_outcome(run_program("lf-scene", "--out scene --width 48 --height 36 --frames 8", folder_.path()), 0);
    fs::current_path(folder_ / "scene");
    test::expect_outcome(run_program("lf-path", "--rig rig.json --out views.json --frames 8"), 0);
  }
  ~FilmFolder() { fs::current_path(before_); }

 private:
  TempDir folder_;
  fs::path before_;
};

// Collects GStreamer's log from warning level, without numbers and without messages that every pipeline logs.
class ProcessOutput {
 public:
  ProcessOutput() {
    gst_debug_remove_log_function(gst_debug_log_default);
    gst_debug_set_default_threshold(GST_LEVEL_WARNING);
    gst_debug_add_log_function(note, this, nullptr);
  }
  ~ProcessOutput() {
    gst_debug_remove_log_function_by_data(this);
    gst_debug_set_default_threshold(GST_LEVEL_NONE);
    gst_debug_add_log_function(gst_debug_log_default, nullptr, nullptr);
  }
  Names lines() {
    std::lock_guard lock(mutex_);
    return lines_;
  }

 private:
  static void note(GstDebugCategory* category, GstDebugLevel level, const gchar*, const gchar* function, gint, GObject*,
                   GstDebugMessage* message, gpointer data) {
    // filesrc in pull mode logs that its pad is not active yet, matroskademux that an index follows the last cluster.
    static const Names of_any = {"gst_base_src_start_complete", "gst_matroska_demux_peek_cluster_info"};
    if (level > GST_LEVEL_WARNING || of_any.contains(function)) return;
    auto* self = static_cast<ProcessOutput*>(data);
    const std::string text =
        std::string(gst_debug_category_get_name(category)) + ": " + function + ": " + gst_debug_message_get(message);
    std::lock_guard lock(self->mutex_);
    self->lines_.insert(std::regex_replace(text, std::regex("0x[0-9a-f]+|[0-9]+"), "N"));
  }
  std::mutex mutex_;
  Names lines_;
};

// Runs a launch line to EOS or, if it is endless, until every sink has received a few pictures. Replaces windows.
// Returns the errors, or "".
std::string run_line(std::string line, size_t expected_sinks, int pictures) {
  line = std::regex_replace(line, std::regex("autovideosink"), "fakesink sync=true");
  line = std::regex_replace(line, std::regex("\\\\([()])"), "$1");  // shell escapes
  const test::PipelinePtr owner = test::launch(line);
  GstElement* pipeline = owner.get();
  std::vector<std::atomic<int>> counts(expected_sinks);
  size_t sinks = 0;
  GstIterator* all = gst_bin_iterate_sinks(GST_BIN(pipeline));
  GValue item = G_VALUE_INIT;
  while (gst_iterator_next(all, &item) == GST_ITERATOR_OK) {
    if (sinks < expected_sinks)
      test::on_buffers(GST_ELEMENT(g_value_get_object(&item)), "sink", [&n = counts[sinks]](GstBuffer*) { n++; });
    sinks++;
    g_value_reset(&item);
  }
  g_value_unset(&item);
  gst_iterator_free(all);
  std::string result = sinks == expected_sinks ? "" : std::to_string(sinks) + " sinks";

  gst_element_set_state(pipeline, GST_STATE_PLAYING);
  g_autoptr(GstBus) bus = gst_element_get_bus(pipeline);
  const auto enough = [&] {
    return std::all_of(counts.begin(), counts.end(), [&](const std::atomic<int>& n) { return n >= pictures; });
  };
  bool ended = false;
  const gint64 deadline = g_get_monotonic_time() + 60 * G_USEC_PER_SEC;
  // Finite lines run to EOS, so that the files they write are complete.
  const bool endless =
      contains(line, "is-live=true") || (contains(line, "lfviewsrc") && !contains(line, "is-live=false"));
  while (result.empty() && !ended && !(endless && enough())) {
    const test::MessagePtr message(
        gst_bus_timed_pop_filtered(bus, 50 * GST_MSECOND, GstMessageType(GST_MESSAGE_ERROR | GST_MESSAGE_EOS)));
    ended = message != nullptr;
    if (ended && GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_ERROR) result = test::text_of(message.get());
    if (g_get_monotonic_time() > deadline) result = "no end after a minute";
  }
  if (result.empty() && !enough()) result = "ended after " + std::to_string(counts[0]) + " buffers";
  gst_element_set_state(pipeline, GST_STATE_NULL);
  return result;
}

// A busy machine causes occasional warnings about lateness: only messages of every run count.
TEST(Readme, LaunchLinesCauseNoWarnings) {
  const FilmFolder folder;
  for (const std::string& line : launch_lines(kReadme, "Launch lines")) {
    const size_t sinks = line.find("view-id=1") == std::string::npos ? 1 : 2;
    Names each_time;
    for (int run = 0; run < 3 && (run == 0 || !each_time.empty()); run++) {
      ProcessOutput said;
      EXPECT_EQ(run_line(line, sinks, 8), "") << line;
      Names both, lines = said.lines();
      for (const std::string& text : lines)
        if (run == 0 || each_time.contains(text)) both.insert(text);
      each_time = both;
    }
    EXPECT_THAT(each_time, IsEmpty()) << line;
  }
}

TEST(Readme, LaunchLinesWork) {
  const FilmFolder folder;
  const std::vector<std::string> lines = launch_lines(kReadme, "Launch lines");
  ASSERT_EQ(lines.size(), 5u);
  EXPECT_EQ(run_line(lines[0], 1, 8), "");
  EXPECT_TRUE(fs::exists("out_007.png"));
  EXPECT_EQ(run_line(lines[1], 1, 1), "");
  EXPECT_GT(fs::file_size("view.mkv"), 8 * 500u);
  EXPECT_EQ(run_line(lines[2], 1, 5), "");
  EXPECT_EQ(run_line(lines[3], 2, 5), "");
  EXPECT_EQ(run_line(lines[4], 1, 5), "");
}

// Except for lines for several hosts, which tests/pipelines/one_line_test.cc runs on one host.
TEST(Readme, OneLineSuffices) {
  const FilmFolder folder;
  const std::vector<std::string> lines = launch_lines(kEmbedding, "One line");
  ASSERT_GE(lines.size(), 3u);
  EXPECT_EQ(run_line(lines[0], 1, 8), "");
  EXPECT_TRUE(fs::exists("view_007.png"));
  EXPECT_EQ(run_line(lines[1], 2, 5), "");
  EXPECT_THAT(lines[2], HasSubstr("playbin uri=lf://$PWD/rig.json"));
  const std::string text = document(kReadme), begin = "\ngst-launch-1.0 ";
  const size_t first = text.find(begin) + begin.size();
  EXPECT_EQ(run_line(text.substr(first, text.find('\n', first) - first), 1, 5), "") << "the very first line";
}

}  // namespace
}  // namespace lf
