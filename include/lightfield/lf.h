// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

// Includes lightfield.h, and defines the short name `lf` for its namespace. Programs that use `lf` for something else
// include lightfield.h instead.
#include <lightfield/lightfield.h>

namespace lf = lightfield;
