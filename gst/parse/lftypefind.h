// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/gst.h>

// Registers the typefinders of request streams (.lfq), answer streams (.lfa) and rigs (rig.json).
gboolean lf_typefind_register(GstPlugin* plugin);
