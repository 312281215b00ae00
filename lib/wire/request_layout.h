// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "view/view_request.h"
#include "wire/bytes.h"
#include "wire/unit.h"

// What the units of a request stream have in common; see spec.md.
namespace lf::wire {

inline constexpr uint16_t kAbsoluteTime = 1, kProbe = 2, kRehearsal = 4, kOfSet = 8;  // in the flags of the unit
inline constexpr size_t kRequestHeadBytes = kUnitHeaderBytes + 29;                    // all fields up to the quality

// Throws Error naming the field. The size of the view is checked with the rest of it.
void check_request_head(const RequestHeader& head);

// Writes the unit's header, with flags that only its type has in `more_flags`, and the fields that all types of
// requests begin with.
void put_request_head(Writer& out, uint8_t type, const RequestHeader& head, int width, int height, size_t size,
                      uint16_t more_flags = 0);
// Reads the fields behind the unit's header, whose flags are given. Returns width and height of the view.
std::pair<int, int> get_request_head(Reader& in, uint16_t flags, RequestHeader& head);
// Reads the unit's header and these fields; the Reader that it returns has what follows. *more_flags: those of the
// flags that it is given, which only this type has, that are set; null: it has none. Throws Error if the bytes are not
// exactly one unit of that type, or end before the fields do.
Reader read_request_head(std::span<const uint8_t> bytes, uint8_t type, RequestHeader& head, int& width, int& height,
                         uint16_t* more_flags = nullptr);

// Throws Error if the request ended before `field` did.
void need_more(const Reader& in, const char* field);

void put_vec(Writer& out, const Vec3& v);
Vec3 get_vec(Reader& in);
// The parameters of a lens alone; its model stands elsewhere, as a code. read_lens() throws Error naming the field.
void put_lens(Writer& out, const Lens& lens);
Lens read_lens(Reader& in, uint8_t model_code);

}  // namespace lf::wire
