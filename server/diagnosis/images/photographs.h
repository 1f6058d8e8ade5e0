// What takes part in a diagnosis of photographs, and what a model expects of each: grey levels (0 to 255), pixels.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <absl/status/statusor.h>

#include "server/diagnosis/images/photo_explanations.h"
#include "server/diagnosis/images/pixels/pixel_noise.h"
#include "server/diagnosis/input.h"
#include "server/image/photograph/simulate_photo.h"
#include "server/session/images/image_set.h"

namespace touchstone::diagnosis::images {

// Photographs k = 0 .. size()-1: those of one object follow each other, each object's in the order of the session.
struct Photographs {
  std::shared_ptr<const session::ImageSet> set;
  std::vector<std::string> objects;                                // as in the set
  std::vector<std::shared_ptr<const geometry::Surface>> surfaces;  // one per object
  std::vector<int> row;                                            // of the set
  std::vector<std::string> copies;  // files left out: the pixels of another of the same pose
  std::vector<int> object;          // index into objects
  std::vector<int> pose;  // group of equal commanded poses of one object, numbered by first appearance
  int poses = 0;
  std::vector<std::vector<float>> measured_grey;  // [k][row * width + column]
  std::vector<image::PhotoRequest> requests;      // commanded pose, nominal lens
  PixelNoise noise;  // judged from the pictures alone: repeats of a pose, else neighbouring pixels
  std::shared_ptr<const RecordTable> record;  // of that noise

  int size() const { return static_cast<int>(row.size()); }
  int width() const { return set->camera.width_px; }
  int height() const { return set->camera.height_px; }
  double TimeOf(int k) const;  // session time, s, or the place in the file
};

// Checks that set, model and surfaces belong together. Errors name what is missing.
absl::StatusOr<Photographs> MakePhotographs(const DiagnosisInput& input, ThreadPool* pool);

// The grey levels of an expected photograph become what is recorded of them on average.
void ToRecordedMeans(const RecordTable& record, image::Photo* photo);

// What `model` expects of every photograph; `grey` is what is recorded on average. `details`: also depth_m, ...,
// point_m of each pixel. The same whatever the number of threads.
absl::StatusOr<std::vector<image::Photo>> ExpectPhotographs(const Photographs& photographs,
                                                            const model::Model& model, bool details,
                                                            ThreadPool* pool);

// Root mean square of measured minus expected over all pixels, grey levels.
double RmseGrey(const Photographs& photographs, const std::vector<image::Photo>& expected);

// Sum over the pixels of each of these photographs of (measured - expected)^2. Errors as ExpectPhotographs.
absl::StatusOr<std::vector<double>> SquaredErrors(const Photographs& photographs, const model::Model& model,
                                                  const std::vector<int>& which, ThreadPool* pool);

// What a diagnosis expected, for those who describe what is left: no picture need be simulated again.
struct Expectation {
  Photographs photographs;
  std::vector<image::Photo> before;  // of the given model, with details
  std::vector<image::Photo> after;   // of the improved model, with details; empty if nothing changed
  ExplanationsLeft left;             // none unless a diagnosis was made
};

}  // namespace touchstone::diagnosis::images
