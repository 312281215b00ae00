// SPDX-License-Identifier: LGPL-2.1-or-later
#include "../gst/camsrc/camera_controls.h"

#include <linux/videodev2.h>

#include "gst/gst_test.h"

namespace lf::test {
namespace {

std::string text_of(GstStructure* structure) {
  g_autofree gchar* text = gst_structure_to_string(StructurePtr(structure).get());
  return text;
}

TEST(V4l2Controls, HaveOldAndNewNamesWithModesFirst) {
  EXPECT_EQ(text_of(v4l2_extra_controls(
                {{"exposure", 0.0123}, {"white_balance", std::nullopt}, {"mains_frequency", 50}, {"sharpness", 3.4}})),
            "lightfield-controls, auto_exposure=(int)1, exposure_auto=(int)1, white_balance_automatic=(int)1, "
            "white_balance_temperature_auto=(int)1, exposure_time_absolute=(int)123, exposure_absolute=(int)123, "
            "power_line_frequency=(int)1, sharpness=(int)3;");
  EXPECT_EQ(text_of(v4l2_extra_controls({{"exposure", std::nullopt}, {"mains_frequency", 60}})),
            "lightfield-controls, auto_exposure=(int)3, exposure_auto=(int)3, power_line_frequency=(int)2;");
}

TEST(V4l2Controls, AreReadInUserUnits) {
  std::map<uint32_t, int32_t> device = {{V4L2_CID_EXPOSURE_ABSOLUTE, 157},
                                        {V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_APERTURE_PRIORITY},
                                        {V4L2_CID_GAIN, 12},
                                        {V4L2_CID_POWER_LINE_FREQUENCY, V4L2_CID_POWER_LINE_FREQUENCY_60HZ}};
  const ReadV4l2 read = [&](uint32_t id) {
    const auto found = device.find(id);
    return found == device.end() ? std::nullopt : std::optional(found->second);
  };
  const auto exposure = read_v4l2_control("exposure", read);
  ASSERT_TRUE(exposure);
  EXPECT_TRUE(exposure->automatic);
  EXPECT_DOUBLE_EQ(*exposure->value, 0.0157);
  device[V4L2_CID_EXPOSURE_AUTO] = V4L2_EXPOSURE_MANUAL;
  EXPECT_FALSE(read_v4l2_control("exposure", read)->automatic);
  EXPECT_EQ(read_v4l2_control("gain", read)->value, 12);
  EXPECT_FALSE(read_v4l2_control("gain", read)->automatic) << "the device has no such switch";
  EXPECT_EQ(read_v4l2_control("mains_frequency", read)->value, 60);
  EXPECT_FALSE(read_v4l2_control("focus", read)) << "no such control";
  EXPECT_FALSE(read_v4l2_control("sharpness", read)) << "not a control with a unit";
}

TEST(CameraControls, SetPropertiesOfAllElementsInABin) {
  const ElementPtr bin(gst_parse_bin_from_description("videotestsrc ! videobalance ! identity", TRUE, nullptr));
  gst_object_ref_sink(bin.get());
  const Controls wanted = {{"brightness", 0.25}, {"sleep-time", 70.2}, {"exposure", 0.1}, {"nothing", 3}};
  apply_controls(bin.get(), wanted);
  const StructurePtr controls(read_controls(bin.get(), wanted)), values(read_control_values(bin.get(), wanted));
  double number = 0;
  EXPECT_TRUE(gst_structure_get_double(controls.get(), "sleep-time", &number));
  EXPECT_EQ(number, 70);
  EXPECT_TRUE(gst_structure_get_double(values.get(), "brightness", &number));
  EXPECT_EQ(number, 0.25);
  gboolean taken = TRUE;
  for (const char* name : {"exposure", "nothing"}) {
    EXPECT_TRUE(gst_structure_get_boolean(controls.get(), name, &taken) && !taken) << name;
    EXPECT_FALSE(gst_structure_has_field(values.get(), name));
  }
}

// Controls do not apply to a source that is a launch line: the line itself sets all properties.
TEST(CameraControls, DoNotChangeLaunchLines) {
  const ElementPtr source(gst_element_factory_make("v4l2src", nullptr));
  if (!source) GTEST_SKIP() << "v4l2src is not installed";
  gst_object_ref_sink(source.get());
  gst_util_set_object_arg(G_OBJECT(source.get()), "extra-controls", "c,contrast=7,gain=1");
  apply_controls(source.get(), {{"gain", 5}});
  EXPECT_THAT(text_of(get<GstStructure*>(source.get(), "extra-controls")),
              AllOf(HasSubstr("contrast=(int)7"), HasSubstr(" gain=(int)5")));
}

}  // namespace
}  // namespace lf::test
