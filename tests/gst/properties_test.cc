// SPDX-License-Identifier: LGPL-2.1-or-later
#include "common/properties.h"

#include "support/test.h"

namespace lf {
namespace {

enum class Colour { kRed, kGreen };

GType colour_type() {
  static const GEnumValue values[] = {{0, "Red", "red"}, {1, "Green", "green"}, {0, nullptr, nullptr}};
  static const GType type = g_enum_register_static("LfTestColour", values);
  return type;
}

struct Settings {
  std::string path, list;
  bool on = true;
  gint shift = -3;
  guint count = 7;
  gint64 frames = -1;
  guint64 delay = 500;
  double distance = 0.5;
  Colour colour = Colour::kGreen;
  gint rate_n = 15, rate_d = 2;
  bool operator==(const Settings&) const = default;

  static PropertyTable<Settings>& properties() {
    using S = Settings;
    static PropertyTable<S> table = {
        property<&S::path>(kWhilePlaying, "path", "Path", "A file"),
        property<&S::list>(kWhileReady, "list", "List", "Numbers", ""),
        property<&S::on>(kWhilePlaying, "on", "On", "Or off"),
        property<&S::shift>(kWhilePlaying, "shift", "Shift", "Pixels", -10, 10),
        property<&S::count>(kWhilePlaying, "count", "Count", "Of them", 1, 9),
        property<&S::frames>(kWhilePlaying, "frames", "Frames", "Of a film", -1, G_MAXINT64),
        property<&S::delay>(kWhilePlaying, "delay", "Delay", "Nanoseconds", 0, G_MAXUINT64),
        property<&S::distance>(kWhilePlaying, "distance", "Distance", "Metres", 0, 1e9),
        property<&S::colour>(kWhilePlaying, "colour", "Colour", "Of it", colour_type()),
        fraction_property<&S::rate_n, &S::rate_d>(kWhilePlaying, "rate", "Rate", "A second", 1, G_MAXINT),
    };
    return table;
  }
};

constexpr guint kFirstId = 3;

struct Thing {
  GObject parent;
  Settings* settings;
};
struct ThingClass {
  GObjectClass parent_class;
};
G_DEFINE_TYPE(Thing, thing, G_TYPE_OBJECT)

Settings& settings_of(gpointer object) { return *static_cast<Thing*>(object)->settings; }

void thing_init(Thing* self) { self->settings = new Settings; }

void thing_class_init(ThingClass* klass) {
  GObjectClass* object_class = G_OBJECT_CLASS(klass);
  object_class->set_property = [](GObject* object, guint id, const GValue* value, GParamSpec*) {
    Settings::properties().set(settings_of(object), id, value);
  };
  object_class->get_property = [](GObject* object, guint id, GValue* value, GParamSpec*) {
    Settings::properties().get(settings_of(object), id, value);
  };
  object_class->finalize = [](GObject* object) {
    delete &settings_of(object);
    G_OBJECT_CLASS(thing_parent_class)->finalize(object);
  };
  EXPECT_EQ(Settings::properties().install(object_class, kFirstId), kFirstId + 10);
}

class PropertyTableTest : public testing::Test {
 protected:
  ~PropertyTableTest() override { g_object_unref(thing_); }
  Thing* thing_ = static_cast<Thing*>(g_object_new(thing_get_type(), nullptr));
};

TEST_F(PropertyTableTest, InitialValueOfAFieldIsTheDefault) {
  guint count = 0;
  g_autofree GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(thing_), &count);
  ASSERT_EQ(count, 10u);
  for (guint i = 0; i < count; i++) {
    GValue value = G_VALUE_INIT;
    g_value_init(&value, specs[i]->value_type);
    g_object_get_property(G_OBJECT(thing_), specs[i]->name, &value);
    EXPECT_TRUE(g_param_value_defaults(specs[i], &value)) << specs[i]->name;
    EXPECT_EQ((specs[i]->flags & GST_PARAM_MUTABLE_READY) != 0, is_named(specs[i], "list")) << specs[i]->name;
    g_value_unset(&value);
  }
}

TEST_F(PropertyTableTest, ValuesAreStoredInFields) {
  g_object_set(thing_, "path", "rig.json", "list", "0-3", "on", FALSE, "shift", 4, "count", 8u, "frames",
               gint64{1} << 40, "delay", guint64{1} << 41, "distance", 2.5, "colour", 0, "rate", 30, 1, nullptr);
  const Settings expected = {"rig.json",       "0-3", false,        4,  8, gint64{1} << 40,
                             guint64{1} << 41, 2.5,   Colour::kRed, 30, 1};
  EXPECT_EQ(*thing_->settings, expected);
  Settings read;
  guint count = 0;
  g_autofree GParamSpec** specs = g_object_class_list_properties(G_OBJECT_GET_CLASS(thing_), &count);
  for (guint i = 0; i < count; i++) {
    GValue value = G_VALUE_INIT;
    g_value_init(&value, specs[i]->value_type);
    g_object_get_property(G_OBJECT(thing_), specs[i]->name, &value);
    Settings::properties().set(read, kFirstId + i, &value);
    g_value_unset(&value);
  }
  EXPECT_EQ(read, expected);
}

TEST_F(PropertyTableTest, UnsetTextIsNullUnlessItIsAList) {
  g_object_set(thing_, "path", nullptr, "list", nullptr, nullptr);
  g_autofree gchar *path = nullptr, *list = nullptr;
  g_object_get(thing_, "path", &path, "list", &list, nullptr);
  EXPECT_EQ(path, nullptr);
  EXPECT_STREQ(list, "");
}

}  // namespace
}  // namespace lf
