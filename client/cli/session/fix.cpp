#include "client/cli/session/fix.h"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>

#include <cmath>
#include <filesystem>

#include "client/cli/session/image_set_fix.h"
#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/model/finger_name.h"
#include "server/session/measurements/measurement_fix.h"

namespace touchstone::cli {
namespace {

struct FixOptions {
  std::string file, output;
  std::string touches, swap_fingers, finger_order, swap_objects, axes;
  std::vector<std::string> rename_objects, move_objects;
  double scale_times = 1, scale_lengths = 1, scale_targets = 1, scale_standoff = 1, scale_speed = 1;
  int shift_rows = 0;
  bool reverse_lateral = false, reverse_approach = false, drop_duplicates = false, drop_stale = false,
       plain = false;
  ImageSetFixOptions images;
};

absl::Status Expected(absl::string_view option, absl::string_view text, absl::string_view expected) {
  return absl::InvalidArgumentError(absl::StrCat(option, ": '", text, "': ", expected, " expected"));
}

absl::StatusOr<int> FingerOf(absl::string_view option, const std::string& name, int fingers) {
  for (int finger = 0; finger < fingers; ++finger)
    if (model::FingerName(finger, fingers) == name) return finger;
  return Expected(option, name,
                  absl::StrCat("a finger from ", model::FingerName(0, fingers), " to ",
                               model::FingerName(fingers - 1, fingers), " was"));
}

absl::Status ReadFingers(const FixOptions& options, int fingers, session::MeasurementFix* fix) {
  if (options.swap_fingers.empty() && options.finger_order.empty()) return absl::OkStatus();
  const bool swap = !options.swap_fingers.empty();
  const char* const option = swap ? "--swap-fingers" : "--finger-order";
  std::vector<int> named;
  for (const std::string& name :
       std::vector<std::string>(absl::StrSplit(swap ? options.swap_fingers : options.finger_order, ','))) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const int finger, FingerOf(option, name, fingers));
    named.push_back(finger);
  }
  if (!swap) {
    fix->finger_order = named;
    return absl::OkStatus();
  }
  if (named.size() != 2 || named[0] == named[1])
    return Expected(option, options.swap_fingers, "two fingers were");
  for (int finger = 0; finger < fingers; ++finger) fix->finger_order.push_back(finger);
  std::swap(fix->finger_order[named[0]], fix->finger_order[named[1]]);
  return absl::OkStatus();
}

absl::Status ReadObjects(const FixOptions& options, session::MeasurementFix* fix) {
  if (!options.swap_objects.empty()) {
    const std::vector<std::string> names = absl::StrSplit(options.swap_objects, ',');
    if (names.size() != 2) return Expected("--swap-objects", options.swap_objects, "two names were");
    fix->rename_objects = {{names[0], names[1]}, {names[1], names[0]}};
  }
  for (const std::string& text : options.rename_objects) {
    const std::pair<std::string, std::string> names = absl::StrSplit(text, absl::MaxSplits('=', 1));
    if (names.first.empty() || names.second.empty()) return Expected("--rename-object", text, "OLD=NEW was");
    fix->rename_objects.push_back(names);
  }
  for (const std::string& text : options.move_objects) {
    const std::pair<std::string, std::string> parts = absl::StrSplit(text, absl::MaxSplits('=', 1));
    const std::vector<std::string> numbers = absl::StrSplit(parts.second, ',');
    Eigen::Vector3d moved_m;
    bool good = numbers.size() == 3 && !parts.first.empty();
    for (size_t axis = 0; good && axis < 3; ++axis) {
      good = absl::SimpleAtod(numbers[axis], &moved_m[axis]) && std::isfinite(moved_m[axis]);
      moved_m[axis] = ToSi(Unit::kMillimetre, moved_m[axis]);
    }
    if (!good) return Expected("--move-object", text, "NAME=x,y,z in mm was");
    fix->move_objects_m.emplace_back(parts.first, moved_m);
  }
  return absl::OkStatus();
}

absl::Status ReadTouchRanges(const FixOptions& options, session::MeasurementFix* fix) {
  if (options.touches.empty()) return absl::OkStatus();
  for (const std::string& text : std::vector<std::string>(absl::StrSplit(options.touches, ','))) {
    const std::vector<std::string> ends = absl::StrSplit(text, '-');
    uint64_t first = 0, last = 0;
    if (ends.size() > 2 || !absl::SimpleAtoi(ends.front(), &first) || !absl::SimpleAtoi(ends.back(), &last) ||
        last < first)
      return Expected("--touches", text,
                      "a touch's number, or the first and the last of several (48-95), was");
    fix->touches.emplace_back(first, last);
  }
  return absl::OkStatus();
}

absl::Status CheckFactors(const FixOptions& options) {
  for (const auto& [option, factor] : {std::pair<const char*, double>{"--scale-times", options.scale_times},
                                       {"--scale-lengths", options.scale_lengths},
                                       {"--scale-targets", options.scale_targets},
                                       {"--scale-standoff", options.scale_standoff},
                                       {"--scale-speed", options.scale_speed}})
    if (!(factor > 0 && std::isfinite(factor)))
      return Expected(option, ShortestNumber(factor), "a factor above 0 was");
  return absl::OkStatus();
}

absl::Status ReadAxes(const FixOptions& options, std::optional<Eigen::Matrix3d>* fixed) {
  if (options.axes.empty()) return absl::OkStatus();
  absl::StatusOr<Eigen::Matrix3d> axes = session::ParseAxes(options.axes);
  if (!axes.ok())
    return absl::InvalidArgumentError(absl::StrCat("--permute-axes: ", axes.status().message()));
  *fixed = *axes;
  return absl::OkStatus();
}

absl::StatusOr<session::MeasurementFix> ReadFix(const FixOptions& options, int fingers) {
  session::MeasurementFix fix;
  TOUCHSTONE_RETURN_IF_ERROR(ReadTouchRanges(options, &fix));
  TOUCHSTONE_RETURN_IF_ERROR(CheckFactors(options));
  TOUCHSTONE_RETURN_IF_ERROR(ReadFingers(options, fingers, &fix));
  TOUCHSTONE_RETURN_IF_ERROR(ReadObjects(options, &fix));
  fix.plain_text = options.plain;
  fix.drop_duplicates = options.drop_duplicates;
  fix.drop_stale = options.drop_stale;
  fix.shift_rows = options.shift_rows;
  fix.scale_times = options.scale_times;
  fix.scale_targets = options.scale_lengths * options.scale_targets;
  fix.scale_standoff = options.scale_lengths * options.scale_standoff;
  fix.scale_speed = options.scale_speed;
  TOUCHSTONE_RETURN_IF_ERROR(ReadAxes(options, &fix.axes));
  fix.reverse_lateral = options.reverse_lateral;
  fix.reverse_approach = options.reverse_approach;
  if (fix.empty())
    return absl::InvalidArgumentError(
        "nothing to fix was named; touchstone diagnose names the options where it finds a mistake");
  return fix;
}

// What a folder of photographs and a measurement file both may need, for a folder.
absl::Status RunFolderFix(const Cli& cli, const CLI::App& command, const FixOptions& options) {
  // In the order of the help.
  for (const char* option : {"--touches", "--drop-duplicates", "--drop-stale", "--swap-fingers",
                             "--finger-order", "--scale-times", "--scale-targets", "--scale-standoff",
                             "--scale-speed", "--reverse-approach", "--reverse-lateral", "--move-object"})
    if (command.count(option) > 0)
      return absl::InvalidArgumentError(absl::StrCat(option, ": is for measurement files, and ", options.file,
                                                     " is a folder of photographs"));
  session::MeasurementFix shared;
  TOUCHSTONE_RETURN_IF_ERROR(ReadObjects(options, &shared));
  session::ImageSetFix fix;
  fix.rename_objects = shared.rename_objects;
  fix.plain_text = options.plain;
  fix.shift_rows = options.shift_rows;
  fix.scale_lengths = options.scale_lengths;
  TOUCHSTONE_RETURN_IF_ERROR(ReadAxes(options, &fix.axes));
  return FixImageSetFolder(cli, options.file, options.output, options.images, fix);
}

absl::Status RunFix(const Cli& cli, const CLI::App& command, const FixOptions& options) {
  if (std::error_code error; std::filesystem::is_directory(options.file, error))
    return RunFolderFix(cli, command, options);
  for (const char* option : ImageSetFixOptions::kNames)
    if (command.count(option) > 0)
      return absl::InvalidArgumentError(
          absl::StrCat(option, ": is for folders of photographs, and ", options.file, " is none"));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string csv, ReadFile(options.file));
  TOUCHSTONE_ASSIGN_OR_RETURN(const session::MeasurementSet before,
                              session::ParseMeasurementSet(csv, options.file));
  TOUCHSTONE_ASSIGN_OR_RETURN(const session::MeasurementFix fix, ReadFix(options, before.fingers));
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::string fixed, session::FixMeasurementFile(csv, options.file, fix));
  // What was written is read like any other file: a factor may have taken a number out of its range.
  const absl::StatusOr<session::MeasurementSet> after = session::ParseMeasurementSet(fixed, options.output);
  if (!after.ok())
    return absl::InvalidArgumentError(
        absl::StrCat("fixed like this it is no measurement file: ", after.status().message()));
  TOUCHSTONE_RETURN_IF_ERROR(cli.Write(options.output, fixed));
  const int dropped = before.size() - after->size();
  // The format has no place for remarks, so the log is where the change is told.
  cli.LogWritten(options.output,
                 absl::StrCat(" (", options.file, " with ", session::FixOptions(fix, before.fingers), "; ",
                              Counted(after->size(), "touch", "touches"),
                              dropped > 0 ? absl::StrCat(", ", dropped, " dropped") : "", ")"));
  return absl::OkStatus();
}

}  // namespace

void AddSessionFix(Cli* cli, CLI::App* group) {
  auto options = std::make_shared<FixOptions>();
  CLI::App* command = cli->AddCommand(
      group, "fix",
      "Fixes a discrete mistake of a measurement file or of a folder of photographs, as touchstone "
      "diagnose names it (verdict CHECK_DATA). Numbers "
      "that do not change keep their digits; several options are done in the order in which "
      "they stand below.",
      "touchstone session fix set.csv --swap-fingers l,m -o fixed.csv\n"
      "touchstone session fix set.csv --touches 480-959 --swap-fingers l,m -o fixed.csv\n"
      "touchstone session fix set.csv --reverse-lateral -o fixed.csv\n"
      "touchstone session fix from_excel.csv --plain -o set.csv\n"
      "touchstone session fix set.csv --swap-objects lat10,lat15 -o fixed.csv\n"
      "touchstone session fix set.csv --scale-times 1000 -o fixed.csv\n"
      "touchstone session fix set.csv --permute-axes=-y,x,z -o fixed.csv\n"
      "touchstone session fix set.csv --move-object cup=0,0,-20 -o fixed.csv\n"
      "touchstone session fix photos --mirror left-right -o fixed\n"
      "touchstone session fix photos --focal-factor 2 -o fixed",
      [cli, options, group] { return RunFix(*cli, *group->get_subcommand("fix"), *options); });
  cli->AddInput(
      command,
      command->add_option("FILE", options->file, "The measurement file (CSV), or the folder of photographs")
          ->type_name("")
          ->required());
  command
      ->add_option("--touches", options->touches,
                   "Fix these touches alone, by their numbers. Default: all of the file")
      ->type_name("A-B,...");
  command->add_flag("--plain", options->plain,
                    "Write the plain form: UTF-8, commas between fields, decimal points, '-' for minus, "
                    "an end of each line");
  command->add_flag("--drop-duplicates", options->drop_duplicates,
                    "Drop rows whose touch and times repeat an earlier row's to the last digit");
  command->add_flag("--drop-stale", options->drop_stale,
                    "Drop rows whose times repeat those of the row before to the last digit");
  command
      ->add_option("--shift-rows", options->shift_rows,
                   "The times (the picture) of each row belong so many rows further down (up: below 0); rows "
                   "that get none are "
                   "dropped")
      ->type_name("ROWS");
  CLI::Option* swap =
      command->add_option("--swap-fingers", options->swap_fingers, "Exchange the times of two fingers")
          ->type_name("A,B");
  command
      ->add_option("--finger-order", options->finger_order,
                   "The fingers whose times the file's time columns hold, first column first")
      ->type_name("A,B,...")
      ->excludes(swap);
  CLI::Option* names =
      command->add_option("--swap-objects", options->swap_objects, "Exchange the names of two objects")
          ->type_name("A,B");
  command->add_option("--rename-object", options->rename_objects, "Give an object another name, repeatable")
      ->type_name("OLD=NEW")
      ->take_all()
      ->expected(1)
      ->excludes(names);
  const auto scale = [&](const char* option, double* value, const char* text) {
    command->add_option(option, *value, text)->type_name("F");
  };
  scale("--scale-times", &options->scale_times, "Multiply all times");
  scale("--scale-lengths", &options->scale_lengths,
        "Multiply targets and standoffs; of photographs eye and at");
  scale("--scale-targets", &options->scale_targets, "Multiply targets alone");
  scale("--scale-standoff", &options->scale_standoff, "Multiply standoffs alone");
  scale("--scale-speed", &options->scale_speed, "Multiply speeds");
  command
      ->add_option("--permute-axes", options->axes,
                   "The file's axes that are the object's x, y and z, of targets and vectors; of photographs "
                   "of eye, at and up")
      ->type_name("-y,x,z");
  command->add_flag("--reverse-approach", options->reverse_approach, "Turn the approach vectors round");
  command->add_flag("--reverse-lateral", options->reverse_lateral, "Turn the lateral vectors round");
  command
      ->add_option("--move-object", options->move_objects,
                   "Where an object stood, seen from where the file says, mm: its targets move the other "
                   "way; repeatable")
      ->type_name("NAME=x,y,z")
      ->take_all()
      ->expected(1);
  AddImageSetFixOptions(command, &options->images);
  cli->AddOutput(command, "-o,--output", &options->output,
                 "The file to write; -: to stdout. Of photographs a folder that is not there yet")
      ->required();
}

}  // namespace touchstone::cli
