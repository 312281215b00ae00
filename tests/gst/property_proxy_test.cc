// SPDX-License-Identifier: LGPL-2.1-or-later
//
// Bins forward proxy properties to their children and read them back from there.

#include "gst/gst_test.h"

namespace lf::test {
namespace {

void change(GParamSpec* spec, GValue* value) {
  if (G_IS_PARAM_SPEC_BOOLEAN(spec)) return g_value_set_boolean(value, !g_value_get_boolean(value));
  if (G_IS_PARAM_SPEC_STRING(spec)) return g_value_set_string(value, "another");
  if (G_IS_PARAM_SPEC_DOUBLE(spec)) return g_value_set_double(value, g_value_get_double(value) + 0.5);
  if (G_IS_PARAM_SPEC_UINT64(spec)) return g_value_set_uint64(value, g_value_get_uint64(value) / 2 + 7);
  if (G_IS_PARAM_SPEC_ENUM(spec)) {
    const GEnumClass* values = G_PARAM_SPEC_ENUM(spec)->enum_class;
    const gint now = g_value_get_enum(value);
    return g_value_set_enum(value, values->values[values->values[0].value == now ? 1 : 0].value);
  }
  if (spec->value_type == GST_TYPE_STRUCTURE)
    return g_value_take_boxed(value, gst_structure_new("limits", "max-pixels", G_TYPE_UINT64, guint64{1000}, nullptr));
  if (G_IS_PARAM_SPEC_INT(spec)) return g_value_set_int(value, g_value_get_int(value) / 2 + 1);
  ASSERT_TRUE(G_IS_PARAM_SPEC_UINT(spec)) << g_type_name(spec->value_type);
  const guint now = g_value_get_uint(value);
  g_value_set_uint(value, now < G_PARAM_SPEC_UINT(spec)->maximum ? now + 1 : now - 1);
}

std::string text_of(GObject* object, const char* name) {
  GValue value = G_VALUE_INIT;
  g_value_init(&value, g_object_class_find_property(G_OBJECT_GET_CLASS(object), name)->value_type);
  g_object_get_property(object, name, &value);
  g_autofree gchar* text = gst_value_serialize(&value);
  g_value_unset(&value);
  return text ? text : "";
}

std::vector<ElementPtr> parts_with(GstElement* bin, const char* name) {
  std::vector<ElementPtr> parts;
  GstIterator* all = gst_bin_iterate_recurse(GST_BIN(bin));
  GValue item = G_VALUE_INIT;
  while (gst_iterator_next(all, &item) == GST_ITERATOR_OK) {
    GstElement* part = GST_ELEMENT(g_value_get_object(&item));
    if (g_object_class_find_property(G_OBJECT_GET_CLASS(part), name))
      parts.emplace_back(GST_ELEMENT(gst_object_ref(part)));
    g_value_reset(&item);
  }
  g_value_unset(&item);
  gst_iterator_free(all);
  return parts;
}

void expect_inside(const char* factory, const std::vector<const char*>& names) {
  for (const char* name : names) {
    SCOPED_TRACE(std::string(factory) + " " + name);
    const ElementPtr bin = make_element(factory);
    GParamSpec* spec = g_object_class_find_property(G_OBJECT_GET_CLASS(bin.get()), name);
    ASSERT_TRUE(spec);
    GValue value = G_VALUE_INIT;
    g_value_init(&value, spec->value_type);
    g_object_get_property(G_OBJECT(bin.get()), name, &value);
    const std::string before = text_of(G_OBJECT(bin.get()), name);
    change(spec, &value);
    EXPECT_FALSE(g_param_value_validate(spec, &value)) << "the test's own value is out of range";
    g_object_set_property(G_OBJECT(bin.get()), name, &value);
    g_value_unset(&value);
    const std::string after = text_of(G_OBJECT(bin.get()), name);
    EXPECT_NE(after, before);
    const std::vector<ElementPtr> parts = parts_with(bin.get(), name);
    EXPECT_FALSE(parts.empty());
    for (const ElementPtr& part : parts)
      EXPECT_EQ(text_of(G_OBJECT(part.get()), name), after) << GST_OBJECT_NAME(part.get());
  }
}

TEST(BinProperties, CameraNodeHasPropertiesOfItsFragment) {
  expect_inside("lfcameranode", {"access", "codec", "limits", "max-delay", "max-skew", "post-messages", "renderer",
                                 "resampling", "strip-pixels", "threads"});
}

TEST(BinProperties, NodeSinkHasPropertiesOfItsCameraNode) {
  expect_inside("lfnodesink",
                {"access", "cameras", "codec", "decode", "latency", "limits", "loop", "max-delay", "max-skew",
                 "post-messages", "record", "renderer", "resampling", "retry", "strip-pixels", "threads"});
}

TEST(BinProperties, ViewSourceHasPropertiesOfItsChildren) {
  expect_inside("lfviewsrc", {"x",
                              "y",
                              "z",
                              "yaw",
                              "pitch",
                              "roll",
                              "fov",
                              "aperture",
                              "focus-distance",
                              "margin",
                              "eager",
                              "focus-continuous",
                              "navigation",
                              "nearest-cameras",
                              "focus",
                              "focus-near",
                              "focus-far",
                              "gains",
                              "incomplete",
                              "limits",
                              "max-missed",
                              "monitor-interval",
                              "depth-interval"});
}

}  // namespace
}  // namespace lf::test
