// SPDX-License-Identifier: LGPL-2.1-or-later
// Camera controls, with a fake element like aravissrc: brightness follows exposure and gain; some cameras ignore their
// controls.
#include "../../tools/cameras/lock.h"

#include <gst/base/gstpushsrc.h>
#include <gst/video/video.h>

#include <nlohmann/json.hpp>

#include "../../tools/cameras/doctor.h"
#include "base/text.h"
#include "gst/gst_test.h"
#include "rig/rig_json.h"
#include "support/temp_dir.h"

namespace lf::cameras {
namespace {

GType fake_auto_get_type() {
  static const GEnumValue values[] = {{0, "Off", "off"}, {1, "Once", "once"}, {2, "Continuous", "continuous"}, {}};
  static const GType type = g_enum_register_static("FakeAuto", values);
  return type;
}

struct FakeCamera {
  GstPushSrc parent;
  gdouble exposure, gain;  // exposure in microseconds; gain not in decibels
  gint exposure_auto, gain_auto;
  gboolean stuck;
};
struct FakeCameraClass {
  GstPushSrcClass parent_class;
};
G_DEFINE_TYPE(FakeCamera, fake_camera, GST_TYPE_PUSH_SRC)
enum { PROP_0, PROP_EXPOSURE, PROP_EXPOSURE_AUTO, PROP_GAIN, PROP_GAIN_AUTO, PROP_STUCK };

constexpr char kCaps[] = "video/x-raw, format=RGB, width=64, height=48, framerate=30/1";
constexpr double kChosenExposure = 14000, kChosenGain = 2;

// Simulates automatic exposure; a stuck camera keeps its own exposure forever.
GstFlowReturn fake_fill(GstPushSrc* source, GstBuffer* buffer) {
  auto* self = reinterpret_cast<FakeCamera*>(source);
  if (self->exposure_auto != 0) self->exposure = kChosenExposure;
  if (self->gain_auto != 0) self->gain = kChosenGain;
  const double light = self->stuck ? kChosenExposure * kChosenGain : self->exposure * self->gain;
  gst_buffer_memset(buffer, 0, static_cast<guint8>(std::clamp(light / 200, 0.0, 255.0)), 64 * 48 * 3);
  return GST_FLOW_OK;
}
void fake_set(GObject* object, guint id, const GValue* value, GParamSpec*) {
  auto* self = reinterpret_cast<FakeCamera*>(object);
  switch (id) {
    case PROP_EXPOSURE: self->exposure = g_value_get_double(value); break;
    case PROP_GAIN: self->gain = g_value_get_double(value); break;
    case PROP_EXPOSURE_AUTO: self->exposure_auto = g_value_get_enum(value); break;
    case PROP_GAIN_AUTO: self->gain_auto = g_value_get_enum(value); break;
    default: self->stuck = g_value_get_boolean(value);
  }
}
void fake_get(GObject* object, guint id, GValue* value, GParamSpec*) {
  auto* self = reinterpret_cast<FakeCamera*>(object);
  switch (id) {
    case PROP_EXPOSURE: g_value_set_double(value, self->exposure); break;
    case PROP_GAIN: g_value_set_double(value, self->gain); break;
    case PROP_EXPOSURE_AUTO: g_value_set_enum(value, self->exposure_auto); break;
    case PROP_GAIN_AUTO: g_value_set_enum(value, self->gain_auto); break;
    default: g_value_set_boolean(value, self->stuck);
  }
}
void fake_camera_class_init(FakeCameraClass* klass) {
  auto* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = fake_set;
  object_class->get_property = fake_get;
  const auto number = [&](guint id, const char* name) {
    g_object_class_install_property(object_class, id,
                                    g_param_spec_double(name, name, name, 0, 1e7, 1000, G_PARAM_READWRITE));
  };
  number(PROP_EXPOSURE, "exposure");
  number(PROP_GAIN, "gain");
  const auto automatic = [&](guint id, const char* name) {
    g_object_class_install_property(object_class, id,
                                    g_param_spec_enum(name, name, name, fake_auto_get_type(), 2, G_PARAM_READWRITE));
  };
  automatic(PROP_EXPOSURE_AUTO, "exposure-auto");
  automatic(PROP_GAIN_AUTO, "gain-auto");
  g_object_class_install_property(object_class, PROP_STUCK,
                                  g_param_spec_boolean("stuck", "stuck", "stuck", FALSE, G_PARAM_READWRITE));
  g_autoptr(GstCaps) caps = gst_caps_from_string(kCaps);
  auto* element_class = GST_ELEMENT_CLASS(klass);
  gst_element_class_add_pad_template(element_class, gst_pad_template_new("src", GST_PAD_SRC, GST_PAD_ALWAYS, caps));
  gst_element_class_set_static_metadata(element_class, "Fake camera", "Source/Video", "Fake", "none");
  GST_PUSH_SRC_CLASS(klass)->fill = fake_fill;
}
void fake_camera_init(FakeCamera* self) {
  self->exposure = self->gain = 1000;
  self->exposure_auto = self->gain_auto = 2;
  gst_base_src_set_live(GST_BASE_SRC(self), TRUE);
  gst_base_src_set_format(GST_BASE_SRC(self), GST_FORMAT_TIME);
  gst_base_src_set_do_timestamp(GST_BASE_SRC(self), TRUE);
  gst_base_src_set_blocksize(GST_BASE_SRC(self), 64 * 48 * 3);
}

class LockTest : public testing::Test {
 protected:
  static void SetUpTestSuite() { gst_element_register(nullptr, "fakecamera", GST_RANK_NONE, fake_camera_get_type()); }
  // A pause after each frame prevents busy loops.
  static Rig rig_of(const std::vector<std::string>& sources) {
    Rig rig = make_grid_rig({1, static_cast<int>(sources.size()), 0.1, 60, 64, 48});
    for (size_t i = 0; i < sources.size(); i++) rig.cameras[i].source = sources[i] + " ! identity sleep-time=20000";
    return rig;
  }
  static LockOptions quick() { return {.settle = 0.3, .trusted = true}; }
};

TEST_F(LockTest, UsesTheValuesOfTheReferenceCamera) {
  const ControlValues values = choose_controls(rig_of({"fakecamera"}), quick());
  EXPECT_EQ(values, (ControlValues{{"exposure", kChosenExposure / 1e6}, {"gain", kChosenGain}}));
  LockOptions mains = quick();
  mains.mains = 50;
  EXPECT_NEAR(choose_controls(rig_of({"fakecamera"}), mains).at("exposure"), 0.01, 1e-9) << "no half of a half-wave";
}

TEST_F(LockTest, ExposuresAreMultiplesOfTheFlickerPeriod) {
  EXPECT_NEAR(flicker_free_exposure(0.031, 50), 0.03, 1e-12);
  EXPECT_NEAR(flicker_free_exposure(0.02, 50), 0.02, 1e-12);
  EXPECT_NEAR(flicker_free_exposure(0.004, 50), 0.004, 1e-12) << "shorter than any";
  EXPECT_NEAR(flicker_free_exposure(0.02, 60), 2 / 120.0, 1e-12);
}

TEST_F(LockTest, NamesACameraThatIgnoresControls) {
  const Rig rig = rig_of({"fakecamera", "fakecamera stuck=true", "fakecamera"});
  const ControlValues values = {{"exposure", 0.012}, {"gain", 2}};
  std::vector<std::string> found;
  for (const StuckControl& one : find_stuck_controls(rig, values, quick()))
    found.push_back(std::to_string(one.camera) + " " + one.control + ": " + one.why);
  EXPECT_THAT(found, ElementsAre(mentions("1 exposure", "picture stays"), mentions("1 gain", "picture stays")));
}

TEST_F(LockTest, FailingCameraIsNamed) {
  Rig rig = rig_of({"fakecamera", "nosuchelement"});
  const auto found = find_stuck_controls(rig, {{"exposure", 0.012}}, quick());
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].camera, 1u);
  EXPECT_THAT(found[0].why, HasSubstr("nosuchelement"));
  rig = rig_of({"nosuchelement"});
  EXPECT_THROW(choose_controls(rig, quick()), Error);
}

TEST_F(LockTest, TheDoctorSeesAutomaticControls) {
  const TempDir dir;
  const Rig rig = rig_of({"fakecamera", "fakecamera"});
  nlohmann::json text = nlohmann::json::parse(rig_to_json(rig));
  put_controls({{1, {{"exposure", 0.012}, {"gain", 2}, {"sharpness", 3}}}}, text);
  save_rig(rig, dir / "rig.json", &text);
  const auto read = std::make_shared<const Rig>(load_rig(dir / "rig.json"));
  const DoctorReport exam = run_doctor(read, dir / "rig.json", {.seconds = 1, .trusted = true});
  EXPECT_EQ(exam.cameras[0].controls, (Controls{{"exposure", std::nullopt}, {"gain", std::nullopt}}));
  EXPECT_EQ(exam.cameras[1].controls, (Controls{{"exposure", 0.012}, {"gain", 2}}));
  EXPECT_EQ(exam.cameras[1].unsupported_controls, std::vector<std::string>{"sharpness"});
}

}  // namespace
}  // namespace lf::cameras
