#include "client/source/dataset/dataset_manifest.h"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <google/protobuf/util/json_util.h>

#include "client/source/dataset/lab_units.h"
#include "client/source/dataset/npy.h"
#include "client/source/dataset/sample_text.h"
#include "server/base/process/version.h"
#include "server/base/status.h"

namespace touchstone::client {
namespace {

using Json = nlohmann::ordered_json;

constexpr size_t kLongestShownValue = 80;

const char* TypeName(v1::DataType type) {
  switch (type) {
    case v1::DATA_TYPE_FLOAT32:
      return "float32";
    case v1::DATA_TYPE_FLOAT64:
      return "float64";
    case v1::DATA_TYPE_UINT8:
      return "uint8";
    case v1::DATA_TYPE_INT32:
      return "int32";
    case v1::DATA_TYPE_UINT64:
      return "uint64";
    default:
      return "file";
  }
}

// Where a column's numbers stand in a shard, for people and programs that read it.
std::string PlaceOf(const DatasetLayout& layout, const FileColumn& column) {
  const bool file = column.type == v1::DATA_TYPE_BYTES;
  const std::string image = absl::StrCat(".", column.name, ".", layout.image_extension);
  switch (layout.format) {
    case ShardFormat::kWebDataset:
      if (file) return "KEY" + image;
      return column.shape.empty() || IsPoseColumn(column) ? "KEY.json"
                                                          : absl::StrCat("KEY.", column.name, ".npy");
    case ShardFormat::kFolder:
      if (file) return column.name == "image" ? "KEY." + layout.image_extension : "KEY" + image;
      if (IsPoseColumn(column) || column.wire_name == "index" || column.wire_name == "object")
        return "touches.csv";
      if (column.wire_name == "contact_time_s" ||
          (column.wire_name == "descriptor_s" && layout.FindColumn("contact_time_s") == nullptr))
        return "touches.csv";
      return column.name + ".npy";
    case ShardFormat::kHdf5:
      return "/" + column.name;
  }
  return "";
}

// protobuf writes 64-bit integers as strings; in our files they are numbers.
void Unquote(Json* object, const char* key) {
  if (object->contains(key) && (*object)[key].is_string())
    (*object)[key] = std::stoull((*object)[key].get<std::string>());
}

std::string Shown(const Json& value) {
  std::string text = value.dump();
  if (text.size() > kLongestShownValue) text = text.substr(0, kLongestShownValue) + "...";
  return text;
}

void Diff(const std::string& path, const Json& there, const Json& now, std::vector<std::string>* lines) {
  if (there == now) return;
  if (!there.is_object() || !now.is_object()) {
    lines->push_back(absl::StrCat(path, ": ", Shown(there), " there, ", Shown(now), " now"));
    return;
  }
  const std::string prefix = path.empty() ? "" : path + ".";
  for (const auto& [key, value] : there.items()) Diff(prefix + key, value, now.value(key, Json()), lines);
  for (const auto& [key, value] : now.items())
    if (!there.contains(key)) Diff(prefix + key, Json(), value, lines);
}

}  // namespace

std::string RendererName(v1::RendererKind kind) {
  if (kind == v1::RENDERER_KIND_EGL) return "egl";
  return kind == v1::RENDERER_KIND_CPU ? "cpu" : "";
}

v1::RendererKind RendererOfName(const std::string& name) {
  if (name == "egl") return v1::RENDERER_KIND_EGL;
  return name == "cpu" ? v1::RENDERER_KIND_CPU : v1::RENDERER_KIND_UNSPECIFIED;
}

namespace {

google::protobuf::util::JsonPrintOptions OurNames() {
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  return options;
}

}  // namespace

Json SpecToJson(const v1::DatasetSpec& spec) {
  v1::DatasetSpec bare = spec;
  bare.clear_model();
  bare.clear_posterior();
  google::protobuf::util::JsonPrintOptions options = OurNames();
  options.always_print_primitive_fields = true;
  std::string text;
  const auto status = google::protobuf::util::MessageToJsonString(bare, &text, options);
  Json json = status.ok() ? ToLabUnits(Json::parse(text)) : Json::object();
  Unquote(&json, "seed");
  Unquote(&json, "samples");
  if (!spec.draw_models()) json.erase("draw_models");
  return json;
}

namespace {

// In the units of files as it stands: as reports have it.
Json PosteriorToJson(const v1::ModelPosterior& posterior) {
  std::string text;
  const auto status = google::protobuf::util::MessageToJsonString(posterior, &text, OurNames());
  return status.ok() ? Json::parse(text) : Json::object();
}

}  // namespace

Json MakeIdentity(const v1::DatasetSpec& spec, const v1::DatasetHeader& header, const DatasetLayout& layout) {
  Json identity;
  identity["format"] = ShardFormatName(layout.format);
  identity["samples"] = header.samples();
  identity["seed"] = spec.seed();
  identity["shard_size"] = layout.shard_size;
  identity["specification"] = SpecToJson(spec);
  identity["model"] = {{"name", header.model_name()},
                       {"hash", header.model_hash()},
                       {"fingers", header.fingers()},
                       {"spacing_mm", LabNumber(Unit::kMillimetre, header.spacing_m())},
                       {"yaml", header.model_yaml()}};
  if (spec.has_posterior()) identity["posterior"] = PosteriorToJson(spec.posterior());
  identity["objects"] = Json::array();
  for (int i = 0; i < spec.objects_size(); ++i)
    identity["objects"].push_back(
        {{"name", spec.objects(i)},
         {"mesh_hash", i < header.mesh_hashes_size() ? header.mesh_hashes(i) : ""}});
  identity["columns"] = Json::array();
  for (const FileColumn& column : layout.columns)
    identity["columns"].push_back({{"name", column.name},
                                   {"type", TypeName(column.type)},
                                   {"shape", column.shape},
                                   {"unit", UnitSymbol(column.unit)},
                                   {"place", PlaceOf(layout, column)}});
  if (header.renderer() != v1::RENDERER_KIND_UNSPECIFIED)
    identity["renderer"] = RendererName(header.renderer());
  identity["versions"] = {{"source", header.version()}, {"writer", kVersion}};
  return identity;
}

namespace {

absl::StatusOr<v1::DatasetSpec> SpecOf(const Json& manifest, const std::string& origin) {
  if (!manifest.contains("specification") || !manifest.contains("model"))
    return absl::InvalidArgumentError(
        absl::StrCat(origin, ": has no 'specification' and 'model'; is it a dataset.json?"));
  v1::DatasetSpec spec;
  google::protobuf::util::JsonParseOptions options;
  const auto status = google::protobuf::util::JsonStringToMessage(ToSiUnits(manifest["specification"]).dump(),
                                                                  &spec, options);
  if (!status.ok())
    return absl::InvalidArgumentError(
        absl::StrCat(origin, ": 'specification' cannot be read: ", std::string(status.message())));
  const std::string yaml = manifest["model"].value("yaml", "");
  if (!yaml.empty()) spec.mutable_model()->set_yaml(yaml);
  if (manifest.contains("posterior")) {
    const auto read = google::protobuf::util::JsonStringToMessage(manifest["posterior"].dump(),
                                                                  spec.mutable_posterior(), options);
    if (!read.ok())
      return absl::InvalidArgumentError(
          absl::StrCat(origin, ": 'posterior' cannot be read: ", std::string(read.message())));
  }
  if (manifest.contains("renderer"))
    spec.mutable_image()->set_renderer(RendererOfName(manifest["renderer"].get<std::string>()));
  return spec;
}

}  // namespace

absl::StatusOr<v1::DatasetSpec> SpecOfManifest(const Json& manifest, const std::string& origin) {
  try {
    return SpecOf(manifest, origin);
  } catch (const Json::exception& error) {
    return absl::InvalidArgumentError(absl::StrCat(origin, ": ", error.what()));
  }
}

std::string FormatManifest(const DatasetManifest& manifest, bool complete) {
  Json json;
  json["touchstone"] = kManifestFormat;
  json["state"] = complete ? "complete" : "partial";
  json.update(manifest.identity);
  json["shards"] = Json::array();
  for (const auto& [number, shard] : manifest.shards)
    json["shards"].push_back({{"name", shard.name},
                              {"first_index", shard.first_index},
                              {"samples", shard.samples},
                              {"bytes", shard.bytes},
                              {"sha256", shard.sha256}});
  return json.dump(2) + "\n";
}

namespace {

// Asked for a whole number, nlohmann makes one of a fraction or a negative, and of 1e70 anything at all.
absl::StatusOr<uint64_t> WholeNumber(const Json& of, const char* key) {
  const Json& value = of.at(key);
  if (value.is_number_unsigned()) return value.get<uint64_t>();
  return absl::InvalidArgumentError(
      absl::StrCat("'", key, "' is ", Shown(value), "; a whole number was expected"));
}

// nlohmann throws where a value has another type than the one that is asked for, or is not there.
absl::StatusOr<DatasetManifest> ReadFields(Json json) {
  DatasetManifest manifest;
  TOUCHSTONE_ASSIGN_OR_RETURN(const uint64_t shard_size, WholeNumber(json, "shard_size"));
  TOUCHSTONE_ASSIGN_OR_RETURN(const uint64_t samples, WholeNumber(json, "samples"));
  TOUCHSTONE_RETURN_IF_ERROR(ParseShardFormat(json["format"].get<std::string>()).status());
  if (json.contains("renderer")) static_cast<void>(json["renderer"].get<std::string>());
  if (shard_size == 0) return absl::InvalidArgumentError("'shard_size' is 0");
  for (const Json& item : json["shards"]) {
    FinishedShard shard;
    shard.name = item.at("name").get<std::string>();
    TOUCHSTONE_ASSIGN_OR_RETURN(shard.first_index, WholeNumber(item, "first_index"));
    TOUCHSTONE_ASSIGN_OR_RETURN(shard.samples, WholeNumber(item, "samples"));
    TOUCHSTONE_ASSIGN_OR_RETURN(shard.bytes, WholeNumber(item, "bytes"));
    shard.sha256 = item.at("sha256").get<std::string>();
    if (shard.first_index >= samples || shard.first_index % shard_size != 0)
      return absl::InvalidArgumentError(absl::StrCat("shard '", shard.name, "' begins at sample ",
                                                     shard.first_index, ", where none of ", samples,
                                                     " samples, ", shard_size, " a shard, begins"));
    manifest.shards[shard.first_index / shard_size] = std::move(shard);
  }
  for (const char* key : {"touchstone", "state", "shards"}) json.erase(key);
  manifest.identity = std::move(json);
  return manifest;
}

}  // namespace

absl::StatusOr<DatasetManifest> ParseManifest(const std::string& text, const std::string& origin) {
  Json json = Json::parse(text, nullptr, false);
  if (json.is_discarded() || !json.is_object() || !json.contains("touchstone") ||
      json["touchstone"] != kManifestFormat)
    return absl::InvalidArgumentError(absl::StrCat(origin, ": is no touchstone ", kManifestFormat, " file"));
  for (const char* key : {"format", "samples", "shard_size", "shards"})
    if (!json.contains(key)) return absl::InvalidArgumentError(absl::StrCat(origin, ": has no '", key, "'"));
  if (!json["shards"].is_array())
    return absl::InvalidArgumentError(absl::StrCat(origin, ": 'shards' is no list"));
  try {
    absl::StatusOr<DatasetManifest> manifest = ReadFields(std::move(json));
    if (!manifest.ok())
      return absl::InvalidArgumentError(absl::StrCat(origin, ": ", manifest.status().message()));
    return manifest;
  } catch (const Json::exception& error) {
    return absl::InvalidArgumentError(absl::StrCat(origin, ": ", error.what()));
  }
}

std::vector<std::string> DiffIdentities(const Json& there, const Json& now) {
  std::vector<std::string> lines;
  Diff("", there, now, &lines);
  return lines;
}

}  // namespace touchstone::client
