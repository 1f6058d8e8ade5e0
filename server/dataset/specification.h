// What a dataset contains: everything that decides its samples. With the model's and the meshes' hashes it
// makes sample i, bit for bit, whatever the number of threads, the batch size, the part or the replica.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <absl/status/status.h>

#include "server/geometry/surface/surface.h"
#include "server/image/renderers/renderer.h"
#include "server/model/model.h"
#include "server/touch/plan.h"
#include "server/uncertainty/posterior.h"

namespace touchstone::dataset {

enum class ImageEncoding { kRaw, kPng, kJpeg };

// How the column "image" is made.
struct DatasetImage {
  image::ImageOptions options;
  ImageEncoding encoding = ImageEncoding::kRaw;
  int jpeg_quality = 90;
  // image/normalize/normalize.h: a grey picture; options.mask is then the mask that it finds.
  bool normalize = false;
  double vertical_fov_rad = 0.78539816339744831;
  image::RendererKind renderer_kind = image::RendererKind::kAuto;  // asked for
  std::shared_ptr<image::Renderer> renderer;  // that renders; null where a camera takes the images
};

// Which groups of columns a batch carries.
struct ColumnChoice {
  bool index = false;
  bool object = false;
  bool descriptor = false;
  bool contact_time = false;
  bool pose = false;             // target_m, approach, lateral, standoff_m, speed_m_s
  bool contact = false;          // contact_point_m, normal
  bool image = false;            // and depth_m, mask where the options ask for them
  bool std_uncertainty = false;  // and beyond_measured
  bool model_values = false;

  // Names as on the wire; an unknown name is an error that lists the known ones.
  static absl::StatusOr<ColumnChoice> FromNames(const std::vector<std::string>& names);
};

struct DatasetSpecification {
  std::vector<std::shared_ptr<const geometry::Surface>> objects;  // sample i shows objects[i mod count]
  touch::Plan plan;
  std::shared_ptr<const model::Model> model;
  uint64_t seed = 0;
  uint64_t samples = 0;  // 0 with a plan that ends: all of its touches, for every object
  ColumnChoice columns;
  DatasetImage image;
  uint32_t max_draws = 1000;  // for one index, before the stream fails
  // What is open about the model; null: nothing is known of that.
  std::shared_ptr<const uncertainty::Posterior> posterior;
  bool draw_models = false;  // every sample has a model of its own, drawn from the posterior
};

// Where the images of a dataset come from.
enum class ImageOrigin { kRendered, kPhotographed };

// Checks every field and fills in `samples`; errors name the field and what would be right. Rendered images need
// image.renderer.
absl::Status ValidateDataset(DatasetSpecification* specification,
                             ImageOrigin images = ImageOrigin::kRendered);

// From 1 to a million.
absl::Status CheckMaxDraws(uint32_t max_draws);

// Which touch of the plan sample `index` is: a plan that ends goes through its touches for each object in turn; a
// random one numbers its draws by the sample.
inline uint64_t PlanNumber(uint64_t index, size_t objects, bool plan_ends) {
  return plan_ends ? index / objects : index;
}

// Whether what was asked for can be normalised: shaded pictures, in grey, not too small.
absl::Status CheckNormalize(const DatasetImage& image);

// One column of a batch: little endian, packed, C order; the first dimension is the sample.
enum class ColumnType { kFloat32, kUint8, kInt32, kUint64, kBytes };
struct ColumnInfo {
  std::string name;  // the unit is the end of the name: "descriptor_s"
  ColumnType type = ColumnType::kFloat32;
  std::vector<uint32_t> shape;  // of one sample

  size_t BytesPerSample() const;  // 0 for kBytes
};

// The columns of every batch, in their order.
// `open_values`: of the posterior.
std::vector<ColumnInfo> ColumnsOf(const ColumnChoice& choice, const DatasetImage& image, int fingers,
                                  int open_values = 0);
std::vector<ColumnInfo> ColumnsOf(const DatasetSpecification& specification);  // with the model's fingers
int OpenValuesOf(const DatasetSpecification& specification);

}  // namespace touchstone::dataset
