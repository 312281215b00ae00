// SPDX-License-Identifier: LGPL-2.1-or-later
#include "gst/compositor_fixture.h"

namespace lf::test {
namespace {

struct HookedAggregator {
  GstAggregator parent;
  Hooks* hooks;
};
struct HookedAggregatorClass {
  GstAggregatorClass parent_class;
};
G_DEFINE_TYPE(HookedAggregator, hooked_aggregator, GST_TYPE_AGGREGATOR)

Hooks& hooks_of(GstAggregator* element) { return *reinterpret_cast<HookedAggregator*>(element)->hooks; }

GstFlowReturn aggregate(GstAggregator* self, gboolean) {
  hooks_of(self).aggregate();
  for (GList* pad = GST_ELEMENT(self)->sinkpads; pad; pad = pad->next)
    gst_aggregator_pad_drop_buffer(GST_AGGREGATOR_PAD(pad->data));
  return GST_AGGREGATOR_FLOW_NEED_DATA;
}

void hooked_aggregator_class_init(HookedAggregatorClass* klass) {
  static GstStaticPadTemplate sink =
      GST_STATIC_PAD_TEMPLATE("sink_%u", GST_PAD_SINK, GST_PAD_REQUEST, GST_STATIC_CAPS_ANY);
  static GstStaticPadTemplate src = GST_STATIC_PAD_TEMPLATE("src", GST_PAD_SRC, GST_PAD_ALWAYS, GST_STATIC_CAPS_ANY);
  for (GstStaticPadTemplate* pad : {&sink, &src})
    gst_element_class_add_static_pad_template_with_gtype(GST_ELEMENT_CLASS(klass), pad, GST_TYPE_AGGREGATOR_PAD);
  gst_element_class_set_static_metadata(GST_ELEMENT_CLASS(klass), "Hooked aggregator", "Test", "Calls hooks", "tests");
  GstAggregatorClass& agg = klass->parent_class;
  agg.aggregate = aggregate;
  agg.negotiate = [](GstAggregator* self) -> gboolean { return hooks_of(self).negotiate(), TRUE; };
  agg.update_src_caps = [](GstAggregator* self, GstCaps* downstream, GstCaps** caps) {
    return hooks_of(self).update_caps(downstream, caps);
  };
  agg.negotiated_src_caps = [](GstAggregator* self, GstCaps* caps) -> gboolean {
    return hooks_of(self).negotiated(caps);
  };
  agg.decide_allocation = [](GstAggregator* self, GstQuery* query) -> gboolean {
    return hooks_of(self).allocation(query);
  };
}
void hooked_aggregator_init(HookedAggregator*) {}

}  // namespace

GstElement* new_test_aggregator(Hooks* hooks) {
  auto* element = static_cast<HookedAggregator*>(g_object_new(hooked_aggregator_get_type(), nullptr));
  element->hooks = hooks;
  return GST_ELEMENT(element);
}

}  // namespace lf::test
