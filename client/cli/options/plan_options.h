// Options that several commands share: the plan and the image; plans in files.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "client/cli/common/common.h"
#include "client/source/dataset/measurement_csv.h"

namespace touchstone::cli {

// --plan and what belongs to its generators; unset options are the generator's defaults.
struct PlanOptions {
  std::string plan = "sphere";  // sphere, faces or a CSV file
  std::optional<double> step_angle_deg, roll_step_deg, radius_ratio;
  std::optional<uint32_t> samples_per_face, rounds;
  std::optional<double> max_tilt_deg, spread, standoff_mm, stroke_beyond_target_mm;
  std::optional<double> max_incidence_deg;
  std::optional<double> speed_mm_s, touch_interval_s;
  // Each touch is photographed from where it begins: by default so far away that the object's outline shows.
  bool pictures = false;
};
void AddPlanOptions(Cli* cli, CLI::App* command, PlanOptions* options);

// The plan with every default written out, so that a specification means the same for ever. A list's objects,
// in the order of their first row, go to `objects` (may be null).
absl::StatusOr<v1::Plan> MakePlan(const PlanOptions& options, std::vector<std::string>* objects);

// Why most pictures that are taken from where touches of that plan begin show no outline of an object with this box, and
// what would be right; empty: they do.
std::string CloseCameraNote(const v1::Plan& plan, const v1::Object& object, double vertical_fov_rad);

// --image, --format, ...
struct ImageFlags {
  std::string size;  // "224x224"
  std::string format = "grey";
  std::string shading_style = "shaded";
  bool depth = false;
  bool mask = false;
  bool normalize = false;
  int jpeg_quality = 90;
  double fov_deg = 45;
};
void AddImageOptions(CLI::App* command, ImageFlags* options);
absl::StatusOr<v1::ImageSpec> MakeImageSpec(const Cli& cli, const ImageFlags& options,
                                            const std::string& encoding);

// One row of a plan of photographs: a file with the columns of images.csv.
struct PlannedPicture {
  std::string file;  // its name
  v1::View view;
};
// Those of `object`, in the order of the rows. None (no value) if the file is a plan of touches. NOT_FOUND, with the
// objects that it has, where no row is of it.
absl::StatusOr<std::optional<std::vector<PlannedPicture>>> ReadPictures(const std::string& path,
                                                                        const std::string& object);

// Reads a plan or measurement file.
absl::StatusOr<std::vector<client::MeasuredTouch>> ReadTouches(const std::string& path);

}  // namespace touchstone::cli
