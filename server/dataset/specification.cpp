#include "server/dataset/specification.h"

#include <absl/strings/str_cat.h>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/image/normalize/normalize.h"
#include "server/image/photograph/photo_image.h"

namespace touchstone::dataset {
namespace {

struct ColumnName {
  const char* name;
  bool ColumnChoice::*field;
};
constexpr ColumnName kColumnNames[] = {
    {"index", &ColumnChoice::index},
    {"object", &ColumnChoice::object},
    {"descriptor", &ColumnChoice::descriptor},
    {"contact_time", &ColumnChoice::contact_time},
    {"pose", &ColumnChoice::pose},
    {"contact", &ColumnChoice::contact},
    {"image", &ColumnChoice::image},
    {"std_uncertainty", &ColumnChoice::std_uncertainty},
    {"model_values", &ColumnChoice::model_values},
};

absl::Status ValidateImage(const DatasetImage& image, ImageOrigin origin) {
  // Any camera will do: sizes and the field of view are what is checked here.
  image::Camera camera;
  camera.eye_m = {1, 0, 0};
  camera.vertical_fov_rad = image.vertical_fov_rad;
  TOUCHSTONE_RETURN_IF_ERROR(image::ValidateImageRequest(camera, image.options));
  if (image.jpeg_quality < 1 || image.jpeg_quality > 100)
    return absl::InvalidArgumentError(
        absl::StrCat("image.jpeg_quality = ", image.jpeg_quality, ": must be from 1 to 100"));
  TOUCHSTONE_RETURN_IF_ERROR(CheckNormalize(image));
  if (image.renderer == nullptr && origin == ImageOrigin::kRendered)
    return absl::FailedPreconditionError(
        "images were asked for, but this source has no renderer: see `touchstone doctor`");
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckNormalize(const DatasetImage& image) {
  if (!image.normalize) return absl::OkStatus();
  if (image.options.format != image::PixelFormat::kGrey)
    return absl::InvalidArgumentError("image.format: a normalised picture is grey; ask for that");
  if (image.options.shading_style != image::ShadingStyle::kShaded)
    return absl::InvalidArgumentError(
        "image.shading_style: what is normalised is a shaded picture; leave it unspecified");
  if (image.options.width < image::kMinNormalizedSide || image.options.height < image::kMinNormalizedSide)
    return absl::InvalidArgumentError(
        absl::StrCat("image.normalize: a picture of ", image.options.width, " x ", image.options.height,
                     " pixels is too small; each side must be from ", image::kMinNormalizedSide));
  return absl::OkStatus();
}

absl::StatusOr<ColumnChoice> ColumnChoice::FromNames(const std::vector<std::string>& names) {
  ColumnChoice choice;
  std::vector<std::string> known;
  for (const ColumnName& column : kColumnNames) known.push_back(column.name);
  for (const std::string& name : names) {
    bool found = false;
    for (const ColumnName& column : kColumnNames) {
      if (name != column.name) continue;
      choice.*column.field = true;
      found = true;
    }
    if (!found)
      return absl::InvalidArgumentError(
          absl::StrCat("columns: '", name, "' is unknown", DidYouMean(name, known)));
  }
  if (names.empty()) choice.descriptor = choice.object = true;
  return choice;
}

absl::Status CheckMaxDraws(uint32_t max_draws) {
  if (max_draws >= 1 && max_draws <= 1'000'000) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("max_draws = ", max_draws, ": must be from 1 to 1000000"));
}

namespace {

// Before anything is drawn from it.
absl::Status CheckPosteriorOf(const DatasetSpecification& specification) {
  if (specification.posterior == nullptr) {
    const char* field = specification.draw_models               ? "draw_models"
                        : specification.columns.std_uncertainty ? "columns: 'std_uncertainty'"
                        : specification.columns.model_values    ? "columns: 'model_values'"
                                                                : nullptr;
    if (field == nullptr) return absl::OkStatus();
    return absl::InvalidArgumentError(absl::StrCat(
        field,
        " needs `posterior`, which a report of `touchstone diagnose --json` has: give the report "
        "(touchstone stream --uncertainty REPORT)"));
  }
  if (specification.columns.model_values && !specification.draw_models)
    return absl::InvalidArgumentError(
        "columns: 'model_values' are those of models that are drawn: set draw_models too (touchstone stream "
        "--models-from REPORT)");
  TOUCHSTONE_RETURN_IF_ERROR(uncertainty::CheckPosterior(*specification.posterior));
  const std::string own = specification.posterior->model.Hash();
  if (specification.model != nullptr && specification.model->Hash() != own)
    return absl::InvalidArgumentError(absl::StrCat(
        "posterior: is that of model '", specification.posterior->model.name, "' (", own.substr(0, 8),
        "), but '", specification.model->name, "' (", specification.model->Hash().substr(0, 8),
        ") was asked for: leave the model out, or diagnose a set with that model"));
  return absl::OkStatus();
}

}  // namespace

absl::Status ValidateDataset(DatasetSpecification* specification, ImageOrigin images) {
  if (specification->objects.empty())
    return absl::InvalidArgumentError(
        "objects is empty: name at least one object (`touchstone objects` lists them)");
  if (specification->objects.size() > 10000)
    return absl::InvalidArgumentError(
        absl::StrCat("objects has ", specification->objects.size(), " names: at most 10000"));
  TOUCHSTONE_RETURN_IF_ERROR(touch::ValidatePlan(&specification->plan));
  TOUCHSTONE_RETURN_IF_ERROR(CheckPosteriorOf(*specification));
  if (specification->columns.image) TOUCHSTONE_RETURN_IF_ERROR(ValidateImage(specification->image, images));
  if (specification->columns.image && images == ImageOrigin::kRendered && specification->model != nullptr)
    TOUCHSTONE_RETURN_IF_ERROR(
        image::CheckPhotographStyle(*specification->model, specification->image.options));
  TOUCHSTONE_RETURN_IF_ERROR(CheckMaxDraws(specification->max_draws));

  const auto generator =
      touch::MakePoseGenerator(specification->plan, specification->objects[0]->bounds(), specification->seed);
  const uint64_t available = generator->Count() * specification->objects.size();
  if (specification->samples == 0) specification->samples = available;
  if (specification->samples == 0)
    return absl::InvalidArgumentError(
        "samples = 0: a sphere plan has no end, so say how many samples to draw");
  if (available != 0 && specification->samples > available)
    return absl::OutOfRangeError(absl::StrCat(
        "samples = ", specification->samples, ": the plan has ", generator->Count(), " touches for each of ",
        specification->objects.size(), " objects, so at most ", available));
  if (specification->samples > (uint64_t{1} << 48))
    return absl::InvalidArgumentError(absl::StrCat("samples = ", specification->samples, ": at most 2^48"));
  return absl::OkStatus();
}

size_t ColumnInfo::BytesPerSample() const {
  size_t bytes = 0;
  switch (type) {
    case ColumnType::kFloat32:
    case ColumnType::kInt32:
      bytes = 4;
      break;
    case ColumnType::kUint8:
      bytes = 1;
      break;
    case ColumnType::kUint64:
      bytes = 8;
      break;
    case ColumnType::kBytes:
      return 0;
  }
  for (uint32_t extent : shape) bytes *= extent;
  return bytes;
}

std::vector<ColumnInfo> ColumnsOf(const DatasetSpecification& specification) {
  return ColumnsOf(specification.columns, specification.image, specification.model->fingers,
                   OpenValuesOf(specification));
}

int OpenValuesOf(const DatasetSpecification& specification) {
  return specification.posterior == nullptr ? 0 : static_cast<int>(specification.posterior->values.size());
}

std::vector<ColumnInfo> ColumnsOf(const ColumnChoice& choice, const DatasetImage& image, int finger_count,
                                  int open_values) {
  const uint32_t fingers = finger_count;
  std::vector<ColumnInfo> columns;
  if (choice.index) columns.push_back({"index", ColumnType::kUint64, {}});
  if (choice.object) columns.push_back({"object", ColumnType::kInt32, {}});
  if (choice.descriptor) columns.push_back({"descriptor_s", ColumnType::kFloat32, {fingers}});
  if (choice.contact_time) columns.push_back({"contact_time_s", ColumnType::kFloat32, {fingers}});
  if (choice.pose) {
    columns.push_back({"target_m", ColumnType::kFloat32, {3}});
    columns.push_back({"approach", ColumnType::kFloat32, {3}});
    columns.push_back({"lateral", ColumnType::kFloat32, {3}});
    columns.push_back({"standoff_m", ColumnType::kFloat32, {}});
    columns.push_back({"speed_m_s", ColumnType::kFloat32, {}});
  }
  if (choice.contact) {
    columns.push_back({"contact_point_m", ColumnType::kFloat32, {fingers, 3}});
    columns.push_back({"normal", ColumnType::kFloat32, {fingers, 3}});
  }
  if (choice.std_uncertainty) {
    columns.push_back({"std_uncertainty_s", ColumnType::kFloat32, {fingers}});
    columns.push_back({"beyond_measured", ColumnType::kUint8, {fingers}});
  }
  if (choice.model_values)
    columns.push_back({"model_values", ColumnType::kFloat32, {static_cast<uint32_t>(open_values)}});
  if (choice.image) {
    const uint32_t width = image.options.width, height = image.options.height;
    const uint32_t channels = image.options.format == image::PixelFormat::kRgb ? 3 : 1;
    columns.push_back({"image",
                       image.encoding == ImageEncoding::kRaw ? ColumnType::kUint8 : ColumnType::kBytes,
                       {height, width, channels}});
    if (image.options.depth) columns.push_back({"depth_m", ColumnType::kFloat32, {height, width}});
    if (image.options.mask) columns.push_back({"mask", ColumnType::kUint8, {height, width}});
  }
  return columns;
}

}  // namespace touchstone::dataset
