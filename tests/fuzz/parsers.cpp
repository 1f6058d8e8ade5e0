#include "tests/fuzz/parsers.h"

#include <absl/strings/str_cat.h>

#include <filesystem>
#include <fstream>

#include "client/source/dataset/dataset_manifest.h"
#include "server/base/test_folder.h"
#include "server/effects/all_effects.h"
#include "server/effects/formula/formula_program.h"
#include "server/gateway/arm/protocol/primary_message.h"
#include "server/gateway/arm/protocol/rtde_message.h"
#include "server/gateway/calibration/calibration.h"
#include "server/geometry/files/mesh_file.h"
#include "server/model/model.h"
#include "server/model/surface_map_file.h"
#include "server/service/options/option_table.h"
#include "server/session/images/camera_yaml.h"
#include "server/session/images/images_csv.h"
#include "server/session/journal/journal.h"
#include "server/session/measurements/measurement_csv.h"
#include "tests/fuzz/frame_fuzz.h"

namespace touchstone::fuzz {
namespace {

constexpr char kOrigin[] = "input";

// An error must say what is wrong.
Answer Refusal(const absl::Status& status) {
  return status.message().empty() ? Answer::kWrong : Answer::kRefused;
}

Answer Held(bool held) {
  return held ? Answer::kAccepted : Answer::kWrong;
}

// What is read and written again must be read as the same.
template <typename Read, typename Write>
Answer RoundTrip(absl::string_view bytes, const Read& read, const Write& write) {
  const auto value = read(std::string(bytes), kOrigin);
  if (!value.ok()) return Refusal(value.status());
  const std::string text = write(*value);
  const auto again = read(text, kOrigin);
  return Held(again.ok() && write(*again) == text);
}

// --- meshes

Answer ReadMesh(absl::string_view format, absl::string_view bytes) {
  const auto mesh = geometry::ReadMeshBytes(kOrigin, format, bytes);
  if (!mesh.ok()) return Refusal(mesh.status());
  for (const auto& triangle : mesh->triangles)
    for (const uint32_t vertex : triangle)
      if (vertex >= mesh->vertices_m.size()) return Answer::kWrong;
  return Held(!mesh->triangles.empty());
}
Answer ReadOff(absl::string_view bytes) {
  return ReadMesh("off", bytes);
}
Answer ReadObj(absl::string_view bytes) {
  return ReadMesh("obj", bytes);
}
Answer ReadStl(absl::string_view bytes) {
  return ReadMesh("stl", bytes);
}
Answer ReadPly(absl::string_view bytes) {
  return ReadMesh("ply", bytes);
}

// --- tables

Answer ReadMeasurements(absl::string_view bytes) {
  const auto touches = session::ParseMeasurements(std::string(bytes), kOrigin);
  if (!touches.ok()) return Refusal(touches.status());
  // A file without rows has no columns of times, which a file must have.
  if (touches->empty()) return Answer::kAccepted;
  const std::string text = session::FormatMeasurements(*touches);
  const auto again = session::ParseMeasurements(text, kOrigin);
  return Held(again.ok() && session::FormatMeasurements(*again) == text);
}

Answer ReadImages(absl::string_view bytes) {
  return RoundTrip(bytes, session::ParseImagesCsv, session::FormatImagesCsv);
}

// --- models

Answer ReadModel(absl::string_view bytes) {
  const auto model = model::ParseModel(std::string(bytes), kOrigin, effects::Catalogue());
  if (!model.ok()) return Refusal(model.status());
  const auto again = model::ParseModel(model::FormatModel(*model), kOrigin, effects::Catalogue());
  return Held(again.ok() && again->Hash() == model->Hash());
}

Answer ReadFormula(absl::string_view bytes) {
  const auto program = effects::FormulaProgram::Compile(std::string(bytes));
  if (!program.ok()) return Refusal(program.status());
  effects::FormulaProgram::Loan loan(**program);
  for (size_t k = 0; k < (*program)->names().size(); ++k) loan->inputs()[k] = 0.5 + static_cast<double>(k);
  loan->Value();
  return Answer::kAccepted;
}

Answer ReadSurfaceMap(absl::string_view bytes) {
  return RoundTrip(bytes, model::ParseSurfaceMap, model::FormatSurfaceMap);
}

Answer ReadManifest(absl::string_view bytes) {
  const auto manifest = client::ParseManifest(std::string(bytes), kOrigin);
  if (!manifest.ok()) return Refusal(manifest.status());
  const auto spec = client::SpecOfManifest(manifest->identity, kOrigin);
  if (!spec.ok()) return Refusal(spec.status());
  const auto again = client::ParseManifest(client::FormatManifest(*manifest, true), kOrigin);
  return Held(again.ok() && again->identity == manifest->identity &&
              again->shards.size() == manifest->shards.size());
}

// --- a rig's files

Answer ReadCamera(absl::string_view bytes) {
  return RoundTrip(bytes, session::ParseCameraYaml, session::FormatCameraYaml);
}

Answer ReadCalibrationFile(absl::string_view bytes) {
  using gateway::calibration::FormatCalibration;
  using gateway::calibration::ParseCalibration;
  const auto calibration = ParseCalibration(std::string(bytes), kOrigin);
  if (!calibration.ok()) return Refusal(calibration.status());
  return Held(ParseCalibration(FormatCalibration(*calibration), kOrigin).ok());
}

// A configuration file with a key of each type, as those of server and gateway are.
Answer ReadConfiguration(absl::string_view bytes) {
  std::string text = "before";
  int whole = 1;
  double real = 1;
  bool yes = false;
  std::vector<std::string> texts;
  std::vector<double> reals;
  const std::vector<service::Option> options = {
      {"listen", "an address", &text}, {"threads", "a number", &whole}, {"arm.speed", "a number", &real},
      {"log_json", "a switch", &yes},  {"mesh", "files", &texts},       {"arm.box", "numbers", &reals}};
  const absl::Status status = service::ReadToml(std::string(bytes), kOrigin, options, {});
  return status.ok() ? Answer::kAccepted : Refusal(status);
}

// SQLite reads files, and puts others beside them.
Answer ReadJournal(absl::string_view bytes) {
  static const TestFolder folder;
  const std::string path = folder.Path("session.db");
  std::filesystem::remove_all(folder.path());
  std::filesystem::create_directories(folder.path());
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  const auto journal = session::Journal::Open(path, session::Journal::Mode::kReadOnly);
  if (!journal.ok()) return Refusal(journal.status());
  const auto sessions = (*journal)->Sessions();
  if (!sessions.ok()) return Refusal(sessions.status());
  const auto unfinished = (*journal)->Unfinished();
  return unfinished.ok() ? Answer::kAccepted : Refusal(unfinished.status());
}

// --- a rig's wire

// To the end of the stream, or to where it cannot be understood any more. A byte before says in what pieces it comes.
template <typename Stream, typename Use>
Answer ReadStream(absl::string_view bytes, const Use& use) {
  Stream stream;
  Answer answer = Answer::kRefused;
  const size_t piece = bytes.empty() ? 1 : static_cast<uint8_t>(bytes[0]) + 1u;
  for (size_t at = 1; at < bytes.size(); at += piece) {
    stream.Append(bytes.substr(at, piece));
    while (true) {
      auto next = stream.Next();
      if (!next.ok()) return Refusal(next.status());
      if (!next->has_value()) break;
      answer = use(**next) ? Answer::kAccepted : answer;
    }
  }
  return answer;
}

Answer ReadRtde(absl::string_view bytes) {
  namespace arm = gateway::arm;
  return ReadStream<arm::RtdeFramer>(bytes, [](const arm::RtdeMessage& message) {
    const bool any = arm::ParseSample(message.payload, 1, true).ok() |
                     arm::ParseSample(message.payload, 1, false).ok() |
                     arm::ParseOutputRecipe(message.payload, true).ok() |
                     arm::ParseInputRecipe(message.payload).ok() | arm::ParseAccepted(message.payload).ok() |
                     arm::ParseControllerVersion(message.payload).ok() | arm::ParseText(message.payload).ok();
    return any;
  });
}

Answer ReadPrimary(absl::string_view bytes) {
  return ReadStream<gateway::arm::PrimaryStream>(bytes, [](const gateway::arm::PrimaryUpdate& update) {
    return update.is_error || update.is_exception || !update.started.empty() || !update.stopped.empty() ||
           update.kinematics.has_value();
  });
}

Answer ReadSerialLine(absl::string_view bytes) {
  Counts counts;
  const std::string wrong = CheckBytes(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size(), &counts);
  if (!wrong.empty()) return Answer::kWrong;
  return counts.good_frames > 0 ? Answer::kAccepted : Answer::kRefused;
}

}  // namespace

const std::vector<Parser>& Parsers() {
  static const std::vector<Parser> parsers = {
      {"off", ReadOff},
      {"obj", ReadObj},
      {"stl", ReadStl},
      {"ply", ReadPly},
      {"measurements", ReadMeasurements},
      {"images", ReadImages},
      {"model", ReadModel},
      {"formula", ReadFormula},
      {"surface_map", ReadSurfaceMap},
      {"manifest", ReadManifest},
      {"camera", ReadCamera},
      {"calibration", ReadCalibrationFile},
      {"configuration", ReadConfiguration},
      {"journal", ReadJournal},
      {"rtde", ReadRtde},
      {"primary", ReadPrimary},
      {"serial", ReadSerialLine},
  };
  return parsers;
}

}  // namespace touchstone::fuzz
