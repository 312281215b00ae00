// SPDX-License-Identifier: LGPL-2.1-or-later
#pragma once

#include <string>
#include <vector>

#include "command_line.h"
#include "image/image.h"
#include "rig/rig.h"
#include "rig/rig_report.h"

// The parts of lf-rig in other files.

// Adds the subcommand "deploy", which writes the configuration of every host from one inventory file
// (docs/reference/files.md).
void add_deploy_command(cli::App& app);

// Subcommands that open cameras (cameras/commands.cc). Each function adds one subcommand to `app`. A subcommand throws
// lf::Error if it fails. Its exit status is 1 if it finds a problem with the cameras.
void add_doctor_command(cli::App& app);
void add_identify_command(cli::App& app);  // the command runs until SIGINT or SIGTERM
void add_lock_command(cli::App& app);
void add_record_command(cli::App& app);
void add_snapshot_command(cli::App& app);

// Checks of "lf-rig check" that need GStreamer (cameras/film_check.cc).
namespace lf::cameras {

// Returns an error for each still that the elements cannot decode, although other programs may.
std::vector<RigFinding> check_still_decoders(const Rig& rig);

// Returns a warning for each film of the rig that has no frames, is cut off, or has another length than most films.
// Films in other formats than Matroska are read completely; such films of more than 1 GiB are not checked.
std::vector<RigFinding> check_films(const Rig& rig);

}  // namespace lf::cameras

// Draws a contact sheet of a rig: the images of its cameras, the home view (the first view of every viewer), and plans
// of the array from behind and from above, with the camera mesh, the viewing directions and a scale. Uses stills and
// the first pictures of sequences. A rig without such pictures gets only the plans. Throws lf::Error for a damaged
// picture.
lf::Image array_sheet(const lf::Rig& rig, const std::string& heading);
