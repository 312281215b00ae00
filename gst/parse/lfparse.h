// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <gst/base/gstbaseparse.h>
#include <gst/gst.h>

G_BEGIN_DECLS

#define LF_TYPE_PARSE (lf_parse_get_type())
G_DECLARE_FINAL_TYPE(LfParse, lf_parse, LF, PARSE, GstBaseParse)

GST_ELEMENT_REGISTER_DECLARE(lfparse)

G_END_DECLS
