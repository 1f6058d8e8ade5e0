#include "server/service/calls/evidence.h"

#include <absl/strings/ascii.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_split.h>

#include <algorithm>

#include "server/base/status.h"
#include "server/base/text/text.h"
#include "server/geometry/files/mesh_file.h"
#include "server/geometry/missing_mesh.h"
#include "server/model/provenance.h"
#include "server/service/core/convert.h"
#include "server/service/core/sent_model.h"
#include "server/service/sessions/measured_set_message.h"
#include "server/service/sessions/stored_session.h"
#include "server/session/images/image_set_file.h"

namespace touchstone::service {
namespace {

constexpr int kMaxAlso = 64;  // model files
constexpr size_t kMaxAlsoBytes = 1 << 20;

absl::Status SetTouches(absl::StatusOr<session::MeasurementSet> set, diagnosis::DiagnosisInput* input) {
  TOUCHSTONE_RETURN_IF_ERROR(set.status());
  input->set = std::make_shared<const session::MeasurementSet>(*std::move(set));
  return absl::OkStatus();
}

absl::Status CheckTimes(const session::MeasurementSet* set) {
  if (set != nullptr && set->fingers == 0)
    return absl::InvalidArgumentError(
        absl::StrCat(set->origin, ":1: has no column t_*_us: it is a plan; what was measured was expected"));
  return absl::OkStatus();
}

// Their pixels, which can be a thousand times their files, count while anybody has them.
absl::Status SetImages(const v1::ImageSetFiles& files, const Resources& resources,
                       diagnosis::DiagnosisInput* input) {
  struct Counted {
    MemoryBudget::Reservation memory;
    session::ImageSet set;
  };
  TOUCHSTONE_ASSIGN_OR_RETURN(MemoryBudget::Reservation memory,
                              resources.memory->Reserve(session::PixelBytes(files)));
  TOUCHSTONE_ASSIGN_OR_RETURN(session::ImageSet images, session::ParseImageSet(files));
  const auto counted = std::make_shared<const Counted>(Counted{std::move(memory), std::move(images)});
  input->images = std::shared_ptr<const session::ImageSet>(counted, &counted->set);
  return absl::OkStatus();
}

// A stored session holds touches, photographs or both.
absl::Status ReadSession(const v1::Evidence& message, const Resources& resources,
                         diagnosis::DiagnosisInput* input) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const std::shared_ptr<const std::string> bytes,
                              resources.sessions->Bytes(message.session()));
  const std::string origin = message.origin().empty() ? message.session() : message.origin();
  const session::MeasurementLimits limits = resources.options.OfMeasurements();
  if (!HoldsImages(*bytes)) return SetTouches(session::ParseMeasurementSet(*bytes, origin, limits), input);
  if (message.has_images())
    return absl::InvalidArgumentError(
        absl::StrCat("evidence.images stands beside session '", message.session(),
                     "', which holds photographs already; one of the two was expected"));
  TOUCHSTONE_ASSIGN_OR_RETURN(StoredSession stored, UnpackSession(*bytes));
  stored.images->set_origin(origin);
  TOUCHSTONE_RETURN_IF_ERROR(SetImages(*stored.images, resources, input));
  if (stored.csv.empty()) return absl::OkStatus();
  return SetTouches(
      session::ParseMeasurementSet(stored.csv, absl::StrCat(origin, "/", session::kTouchesCsv), limits),
      input);
}

absl::Status ReadMeasurements(const v1::Evidence& message, const Resources& resources,
                              diagnosis::DiagnosisInput* input) {
  const std::string origin = message.origin().empty() ? "measurements" : message.origin();
  const session::MeasurementLimits limits = resources.options.OfMeasurements();
  switch (message.measurements_case()) {
    case v1::Evidence::kSession:
      TOUCHSTONE_RETURN_IF_ERROR(ReadSession(message, resources, input));
      break;
    case v1::Evidence::kCsv:
      TOUCHSTONE_RETURN_IF_ERROR(
          SetTouches(session::ParseMeasurementSet(message.csv(), origin, limits), input));
      break;
    case v1::Evidence::kSet:
      TOUCHSTONE_RETURN_IF_ERROR(SetTouches(FromProto(message.set(), origin, limits), input));
      break;
    case v1::Evidence::MEASUREMENTS_NOT_SET:
      if (message.has_images()) break;
      return absl::InvalidArgumentError("evidence.measurements is empty: set session, csv or set, or images");
  }
  return message.has_images() ? SetImages(message.images(), resources, input) : absl::OkStatus();
}

// Every object of the evidence, and where its name first stands: "set.csv:17".
std::vector<std::pair<std::string, std::string>> ObjectsOf(const diagnosis::DiagnosisInput& input) {
  std::vector<std::pair<std::string, std::string>> objects;
  if (const session::MeasurementSet* set = input.set.get(); set != nullptr)
    for (size_t object = 0; object < set->objects.size(); ++object) {
      const auto row =
          std::find(set->object.begin(), set->object.end(), static_cast<int>(object)) - set->object.begin();
      objects.emplace_back(set->objects[object], absl::StrCat(set->origin, ":", set->line[row]));
    }
  if (const session::ImageSet* images = input.images.get(); images != nullptr)
    for (size_t object = 0; object < images->objects.size(); ++object) {
      const auto row = std::find_if(
          images->photographs.begin(), images->photographs.end(),
          [&](const session::PhotographRow& one) { return one.object == static_cast<int>(object); });
      objects.emplace_back(images->objects[object],
                           absl::StrCat(images->origin, "/", session::kImagesCsv, ":", row->line));
    }
  return objects;
}

// "MM" as geometry has it: "mm". A number that has no name becomes what no mesh has.
std::string NameInFiles(const std::string& name, int number) {
  return name.empty() ? absl::StrCat(number) : absl::AsciiStrToLower(name);
}

absl::StatusOr<std::shared_ptr<const geometry::Surface>> ReadSurface(const v1::MeshFile& file) {
  const std::string place = absl::StrCat("mesh '", file.name(), "'");
  geometry::MeshImport import;
  if (file.unit() != v1::MeshFile::LENGTH_UNIT_UNSPECIFIED)
    import.unit = NameInFiles(v1::MeshFile::LengthUnit_Name(file.unit()), file.unit());
  if (file.up() != v1::MeshFile::AXIS_UNSPECIFIED)
    import.up = NameInFiles(v1::MeshFile::Axis_Name(file.up()), file.up());
  if (file.scale() != 0) import.scale = file.scale();
  if (file.fit_mm() != 0) import.fit_mm = file.fit_mm();
  const auto in_place = [&](const absl::Status& status) {
    return absl::Status(status.code(), absl::StrCat(place, ": ", status.message()));
  };
  if (file.format() == v1::MeshFile::FORMAT_UNSPECIFIED)
    return absl::InvalidArgumentError(absl::StrCat(place, ": format is not set; one of ",
                                                   absl::StrJoin(geometry::MeshFormatNames(), ", "),
                                                   " was expected"));
  const std::string format = NameInFiles(v1::MeshFile::Format_Name(file.format()), file.format());
  auto mesh = geometry::ReadMeshBytes(absl::StrCat(file.name(), ".", format), format, file.data(), import);
  if (!mesh.ok()) return in_place(mesh.status());
  auto surface = geometry::Surface::Create(file.name(), *std::move(mesh));
  if (!surface.ok()) return in_place(surface.status());
  return surface;
}

// With the objects of a set at most so many others are looked at.
constexpr size_t kMaxKnownSurfaces = 24;

// One surface an object of the set; every object without one is named.
absl::Status FindSurfaces(const v1::Evidence& message, const Resources& resources,
                          diagnosis::DiagnosisInput* input) {
  std::map<std::string, const v1::MeshFile*> files;
  for (const v1::MeshFile& file : message.meshes())
    if (!files.emplace(file.name(), &file).second)
      return absl::InvalidArgumentError(
          absl::StrCat("meshes: two are named '", file.name(), "'; one per object was expected"));
  std::vector<std::string> missing;
  std::string first_place;
  for (const auto& [name, place] : ObjectsOf(*input)) {
    if (input->surfaces.count(name) > 0) continue;  // touched and photographed
    const auto file = files.find(name);
    const auto served = resources.objects.all().find(name);
    if (file != files.end()) {
      TOUCHSTONE_ASSIGN_OR_RETURN(input->surfaces[name], ReadSurface(*file->second));
    } else if (served != resources.objects.all().end()) {
      input->surfaces[name] = served->second.surface;
    } else if (std::find(missing.begin(), missing.end(), name) == missing.end()) {
      if (missing.empty()) first_place = place;
      missing.push_back(name);
    }
  }
  if (missing.empty()) {
    // Other objects that are known: a mesh may have been taken for another's.
    for (const auto& [name, file] : files)
      if (input->surfaces.size() < kMaxKnownSurfaces && input->surfaces.count(name) == 0) {
        TOUCHSTONE_ASSIGN_OR_RETURN(input->surfaces[name], ReadSurface(*file));
      }
    for (const auto& [name, object] : resources.objects.all())
      if (input->surfaces.size() < kMaxKnownSurfaces) input->surfaces.emplace(name, object.surface);
    return absl::OkStatus();
  }

  std::vector<std::string> known;
  for (const auto& [name, file] : files) known.push_back(name);
  for (const auto& [name, object] : resources.objects.all())
    if (files.count(name) == 0) known.push_back(name);
  return geometry::MissingMesh(absl::StrCat(first_place, ": column object: "), missing, known);
}

absl::Status ReadAlso(const v1::Evidence& message, const Resources& resources,
                      diagnosis::DiagnosisInput* input) {
  if (message.also_yaml_size() > kMaxAlso)
    return absl::InvalidArgumentError(
        absl::StrCat("also_yaml has ", message.also_yaml_size(), " files: at most ", kMaxAlso));
  for (int k = 0; k < message.also_yaml_size(); ++k) {
    const std::string place = absl::StrCat("also_yaml[", k, "]");
    if (message.also_yaml(k).size() > kMaxAlsoBytes)
      return absl::InvalidArgumentError(
          absl::StrCat(place, " has ", message.also_yaml(k).size(), " bytes: at most ", kMaxAlsoBytes));
    TOUCHSTONE_ASSIGN_OR_RETURN(const model::Model model,
                                ParseSentModel(AsModelFile(message.also_yaml(k)), place, resources.options));
    if (model.effects.empty())
      return absl::InvalidArgumentError(
          absl::StrCat(place, ": has no effects; at least one that may be missing was expected"));
    for (const model::EffectInstance& instance : model.effects) input->also.push_back(instance.effect);
  }
  return absl::OkStatus();
}

}  // namespace

std::string AsModelFile(const std::string& yaml) {
  const std::vector<std::string> lines = absl::StrSplit(yaml, '\n');
  const auto begins = [](absl::string_view line) {
    return !line.empty() && line[0] != '#' && !absl::ascii_isspace(static_cast<unsigned char>(line[0]));
  };
  const auto first = std::find_if(lines.begin(), lines.end(), begins);
  const bool whole = std::any_of(lines.begin(), lines.end(), [](const std::string& line) {
    return absl::StartsWith(line, "touchstone:") || absl::StartsWith(line, "effects:") ||
           absl::StartsWith(line, "end_effector:");
  });
  if (first == lines.end() || whole) return yaml;
  std::string text =
      "touchstone: model/1\nname: also\nend_effector: {fingers: 3, spacing_mm: 30}\neffects:\n";
  const bool listed = absl::StartsWith(*first, "-");
  for (auto line = lines.begin(); line != lines.end(); ++line)
    absl::StrAppend(&text, listed ? "  " : line == first ? "  - " : "    ", *line, "\n");
  return text;
}

absl::StatusOr<diagnosis::DiagnosisInput> ReadEvidence(const v1::Evidence& message,
                                                       const Resources& resources, TimesOfSet times) {
  diagnosis::DiagnosisInput input;
  input.seed = message.seed();
  TOUCHSTONE_ASSIGN_OR_RETURN(input.model, FromProto(message.model(), resources));
  if (message.model().has_yaml()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const model::Provenance provenance,
                                model::ReadProvenance(message.model().yaml(), "the model"));
    for (const model::UsedSet& set : provenance.fitted_to) input.fitted_to.push_back(set.sha256);
  }
  TOUCHSTONE_RETURN_IF_ERROR(ReadAlso(message, resources, &input));
  TOUCHSTONE_RETURN_IF_ERROR(ReadMeasurements(message, resources, &input));
  if (times == TimesOfSet::kNeeded) TOUCHSTONE_RETURN_IF_ERROR(CheckTimes(input.set.get()));
  TOUCHSTONE_RETURN_IF_ERROR(FindSurfaces(message, resources, &input));
  return input;
}

}  // namespace touchstone::service
