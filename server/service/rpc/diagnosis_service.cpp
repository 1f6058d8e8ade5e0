#include "server/service/rpc/diagnosis_service.h"

#include <absl/strings/str_cat.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>

#include "server/base/status.h"
#include "server/base/text/over_limit.h"
#include "server/base/text/text.h"
#include "server/base/units.h"
#include "server/diagnosis/diagnose.h"
#include "server/diagnosis/report/message/write_report.h"
#include "server/effects/all_effects.h"
#include "server/service/calls/evidence.h"
#include "server/service/core/convert.h"
#include "server/service/rpc/diagnosis_worker.h"
#include "server/uncertainty/posterior_message.h"

namespace touchstone::service {
namespace {

// What is done with the evidence, once it is read.
struct Work {
  std::function<absl::StatusOr<v1::Report>(const diagnosis::DiagnosisInput&,
                                           const diagnosis::DiagnosisContext&)>
      run;
  TimesOfSet times = TimesOfSet::kNeeded;
  // Of several sessions, the first among them; in the place of `run`.
  std::function<absl::StatusOr<v1::Report>(const std::vector<diagnosis::DiagnosisInput>&,
                                           const diagnosis::DiagnosisContext&)>
      run_sessions = nullptr;
  google::protobuf::RepeatedPtrField<v1::Evidence> further = {};
};
absl::StatusOr<v1::Report> AsReport(const absl::StatusOr<diagnosis::report::Diagnosis>& diagnosis) {
  if (!diagnosis.ok()) return diagnosis.status();
  return diagnosis::report::ToReport(*diagnosis);
}

constexpr int kMaxFurther = 99;  // sessions beside the first
constexpr int kDefaultProposedTouches = 24, kDefaultProposedPhotographs = 12;

// Hash of the set, as a file; empty: it came as columns.
std::string HashOfSet(const v1::Evidence& evidence, const diagnosis::DiagnosisInput& input,
                      const Resources& resources) {
  if (evidence.measurements_case() == v1::Evidence::kCsv) return Sha256Hex(evidence.csv());
  if (evidence.measurements_case() == v1::Evidence::kSession) {
    const auto session = resources.sessions->Find(evidence.session());
    return session.ok() ? session->hash() : "";
  }
  return input.images != nullptr && input.set == nullptr ? input.images->sha256 : "";
}

// A further session under the model and with the meshes of the first.
v1::Evidence SessionOf(const v1::Evidence& first, const v1::Evidence& further) {
  v1::Evidence session = first;
  session.clear_images();
  if (further.measurements_case() == v1::Evidence::kCsv)
    session.set_csv(further.csv());
  else if (further.measurements_case() == v1::Evidence::kSet)
    *session.mutable_set() = further.set();
  else if (further.measurements_case() == v1::Evidence::kSession)
    session.set_session(further.session());
  else
    session.clear_measurements();
  session.set_origin(further.origin());
  return session;
}

// What went in, by its hashes. A set that came as columns is no file: only the client knows where they are from.
void AddProvenance(const v1::Evidence& evidence, const diagnosis::DiagnosisInput& input,
                   const Resources& resources, v1::Report* report) {
  v1::Provenance* provenance = report->mutable_provenance();
  provenance->set_seed(input.seed);
  provenance->set_set_sha256(HashOfSet(evidence, input, resources));
  std::vector<std::string> objects;
  if (input.set != nullptr) objects = input.set->objects;
  if (input.images != nullptr)
    for (const std::string& object : input.images->objects)
      if (std::find(objects.begin(), objects.end(), object) == objects.end()) objects.push_back(object);
  for (const std::string& object : objects) {
    const auto surface = input.surfaces.find(object);
    if (surface == input.surfaces.end()) continue;
    v1::MeshProvenance* mesh = provenance->add_meshes();
    mesh->set_object(object);
    mesh->set_mesh_hash(surface->second->hash());
  }
}

// Reads the evidence, works on it, sends progress and at the end the report. What begins is said at once, so that who waits
// sees that the request has arrived. `send` returns false when the client is gone.
absl::Status Run(grpc::ServerContext* context, const v1::Evidence& evidence, const Work& work,
                 Resources* resources, const std::function<bool(const v1::Progress&)>& send,
                 v1::Report* result) {
  TOUCHSTONE_ASSIGN_OR_RETURN(const Places::Place place, resources->diagnoses->Take(ClientOf(*context)));
  const Clock& clock = *resources->options.clock;
  const auto begin = clock.Now();
  DiagnosisWorker worker(
      [&](const diagnosis::DiagnosisContext& how) -> absl::StatusOr<v1::Report> {
        TOUCHSTONE_ASSIGN_OR_RETURN(const diagnosis::DiagnosisInput input,
                                    ReadEvidence(evidence, *resources, work.times));
        if (work.further.empty()) {
          TOUCHSTONE_ASSIGN_OR_RETURN(v1::Report report, work.run(input, how));
          AddProvenance(evidence, input, *resources, &report);
          return report;
        }
        if (work.further.size() > kMaxFurther)
          return absl::InvalidArgumentError(
              absl::StrCat("further has ", work.further.size(), " sessions: at most ", kMaxFurther));
        std::vector<diagnosis::DiagnosisInput> sessions = {input};
        std::vector<std::string> hashes = {HashOfSet(evidence, input, *resources)};
        for (const v1::Evidence& further : work.further) {
          const v1::Evidence session = SessionOf(evidence, further);
          TOUCHSTONE_ASSIGN_OR_RETURN(sessions.emplace_back(), ReadEvidence(session, *resources, work.times));
          hashes.push_back(HashOfSet(session, sessions.back(), *resources));
        }
        TOUCHSTONE_ASSIGN_OR_RETURN(v1::Report report, work.run_sessions(sessions, how));
        AddProvenance(evidence, input, *resources, &report);
        *report.mutable_provenance()->mutable_session_sha256() = {hashes.begin(), hashes.end()};
        return report;
      },
      resources->pool.get());
  v1::Progress progress = ProgressOfReading();
  if (!send(progress)) worker.Cancel();
  const double max_s = resources->options.max_diagnosis_s;
  const auto late = [&] { return clock.SecondsSince(begin) > max_s; };
  while (!worker.Wait(&progress)) {
    if (context->IsCancelled() || late() || !send(progress)) worker.Cancel();
  }
  if (absl::IsCancelled(worker.report().status()) && late())
    return OverLimit("the diagnosis is not done after seconds:", LimitInWords(max_s), "max_diagnosis_s",
                     max_s);
  if (context->IsCancelled()) return absl::CancelledError("the request was cancelled");
  TOUCHSTONE_RETURN_IF_ERROR(worker.report().status());
  *result = *std::move(worker.report());
  result->set_version(kVersion);
  result->set_duration_s(clock.SecondsSince(begin));
  return absl::OkStatus();
}

template <typename Response>
absl::Status RunAndSend(grpc::ServerContext* context, const v1::Evidence& evidence, const Work& work,
                        Resources* resources, grpc::ServerWriter<Response>* writer, v1::Report* report) {
  Response response;
  StallWatch::Call call(resources->stalls.get(), context);
  const auto send = [&](const v1::Progress& progress) {
    *response.mutable_progress() = progress;
    return call.Wait([&] { return writer->Write(response); });
  };
  TOUCHSTONE_RETURN_IF_ERROR(Run(context, evidence, work, resources, send, report));
  response.clear_progress();
  *response.mutable_report() = *report;
  if (!call.Wait([&] { return writer->Write(response); })) return absl::CancelledError("the client is gone");
  return absl::OkStatus();
}

// The improved model, or the same one if nothing changed, under a name of the client's.
absl::Status SaveModel(const v1::Report& report, const v1::DiagnoseRequest& request, Resources* resources) {
  model::Model model;
  if (report.improved_model_yaml().empty()) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const auto same, FromProto(request.evidence().model(), *resources));
    model = *same;
  } else {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        model, model::ParseModel(report.improved_model_yaml(), "improved_model_yaml", effects::Catalogue()));
  }
  model.name = request.save_model();
  const absl::Status status = resources->models->Create(model);
  if (!status.ok()) return absl::Status(status.code(), absl::StrCat("save_model: ", status.message()));
  spdlog::info("model '{}' added by a diagnosis, hash {}", model.name, model.Hash().substr(0, 8));
  return absl::OkStatus();
}

}  // namespace

grpc::Status DiagnosisService::Compare(grpc::ServerContext* context, const v1::CompareRequest* request,
                                       grpc::ServerWriter<v1::CompareResponse>* writer) {
  v1::Report report;
  std::shared_ptr<const model::Model> other;
  if (request->has_other_model()) {
    absl::StatusOr<std::shared_ptr<const model::Model>> read = FromProto(request->other_model(), *resources_);
    if (!read.ok())
      return ToGrpc(
          absl::Status(read.status().code(), absl::StrCat("other_model: ", read.status().message())));
    other = *std::move(read);
  }
  Work work;
  work.run = [&other](const diagnosis::DiagnosisInput& input, const diagnosis::DiagnosisContext& how) {
    diagnosis::DiagnosisInput asked = input;
    asked.other_model = other;
    return AsReport(touchstone::diagnosis::Compare(asked, how));
  };
  work.run_sessions = [&other](std::vector<diagnosis::DiagnosisInput> sessions,
                               const diagnosis::DiagnosisContext& how) {
    sessions[0].other_model = other;
    return AsReport(touchstone::diagnosis::Compare(sessions, how));
  };
  work.further = request->further();
  const absl::Status status = RunAndSend(context, request->evidence(), work, resources_, writer, &report);
  for (const v1::DataReport& data : report.data())
    if (status.ok() && data.kind() == v1::DataReport::TOUCHES && data.initial().rmse() > 0)
      resources_->last_comparison_rmse_us = data.initial().rmse();
  return ToGrpc(status);
}

grpc::Status DiagnosisService::Diagnose(grpc::ServerContext* context, const v1::DiagnoseRequest* request,
                                        grpc::ServerWriter<v1::DiagnoseResponse>* writer) {
  // Before the work, what can be known before it.
  const std::string& name = request->save_model();
  if (!name.empty()) {
    const absl::Status allowed =
        resources_->access->Require(*context, Role::kAdmin, "Diagnosis.Diagnose with save_model");
    if (!allowed.ok()) return ToGrpc(allowed);
    if (const absl::Status status = ModelStore::CheckName(name); !status.ok())
      return ToGrpc(absl::Status(status.code(), absl::StrCat("save_model: ", status.message())));
  }
  v1::Report report;
  if (request->with_surface_map() && !request->further().empty())
    return ToGrpc(absl::InvalidArgumentError(
        "with_surface_map: is for one session; leave it out, or diagnose one session by itself"));
  Work work;
  work.run = [with_surface_map = request->with_surface_map()](const diagnosis::DiagnosisInput& input,
                                                              const diagnosis::DiagnosisContext& how) {
    diagnosis::DiagnosisInput asked = input;
    asked.with_surface_map = with_surface_map;
    return AsReport(touchstone::diagnosis::Diagnose(asked, how));
  };
  work.run_sessions = [](const std::vector<diagnosis::DiagnosisInput>& sessions,
                         const diagnosis::DiagnosisContext& how) {
    return AsReport(touchstone::diagnosis::Diagnose(sessions, how));
  };
  work.further = request->further();
  absl::Status status = RunAndSend(context, request->evidence(), work, resources_, writer, &report);
  // The report is sent even if the model cannot be kept.
  if (status.ok() && !name.empty()) status = SaveModel(report, *request, resources_);
  return ToGrpc(status);
}

grpc::Status DiagnosisService::Propose(grpc::ServerContext* context, const v1::ProposeRequest* request,
                                       grpc::ServerWriter<v1::ProposeResponse>* writer) {
  const uint32_t most = resources_->options.max_proposed_touches;
  if (request->touches() > most)
    return ToGrpc(OverLimit("touches =", request->touches(), "max_proposed_touches", most));
  const int touches =
      request->touches() == 0 ? kDefaultProposedTouches : static_cast<int>(request->touches());
  if (request->photographs() > most)
    return ToGrpc(OverLimit("photographs =", request->photographs(), "max_proposed_touches", most));
  const int photographs =
      request->photographs() == 0 ? kDefaultProposedPhotographs : static_cast<int>(request->photographs());
  const bool touches_asked = request->touches() > 0, photographs_asked = request->photographs() > 0;
  const Work work = {[=](const diagnosis::DiagnosisInput& input,
                         const diagnosis::DiagnosisContext& how) -> absl::StatusOr<v1::Report> {
    const bool both = input.set != nullptr && input.images != nullptr;
    if (both && touches_asked && photographs_asked)
      return absl::InvalidArgumentError(
          "touches and photographs are both asked for, but a plan is of one kind: ask for one, then for the "
          "other");
    const bool of_touches = input.images == nullptr || (both && touches_asked);
    diagnosis::DiagnosisInput alone = input;
    if (of_touches)
      alone.images = nullptr;
    else
      alone.set = nullptr;
    TOUCHSTONE_ASSIGN_OR_RETURN(v1::Report report, AsReport(touchstone::diagnosis::Propose(
                                                       alone, of_touches ? touches : photographs, how)));
    if (both)
      report.add_warnings(of_touches
                              ? "proposed from the touches alone: the photographs of the set took no part"
                              : "proposed from the photographs alone: the touches of the set took no part");
    return report;
  }};
  v1::Report report;
  return ToGrpc(RunAndSend(context, request->evidence(), work, resources_, writer, &report));
}

grpc::Status DiagnosisService::Check(grpc::ServerContext* context, const v1::CheckRequest* request,
                                     grpc::ServerWriter<v1::CheckResponse>* writer) {
  const uint32_t most = resources_->options.max_proposed_touches;
  if (request->improve() > most)
    return ToGrpc(OverLimit("improve =", request->improve(), "max_proposed_touches", most));
  if (!std::isfinite(request->noise_us()) || request->noise_us() < 0)
    return ToGrpc(absl::InvalidArgumentError(
        absl::StrCat("noise_us = ", request->noise_us(), "; a positive number of us was expected")));
  diagnosis::design::PlanQuestion question;
  question.sigma_s = ToSi(Unit::kMicrosecond, request->noise_us());
  question.improve = static_cast<int>(request->improve());
  question.find = request->find();
  question.between = {request->between().begin(), request->between().end()};
  const Work work = {
      [&question](const diagnosis::DiagnosisInput& input, const diagnosis::DiagnosisContext& how) {
        return AsReport(touchstone::diagnosis::Check(input, question, how));
      },
      TimesOfSet::kNotRead};
  v1::Report report;
  return ToGrpc(RunAndSend(context, request->evidence(), work, resources_, writer, &report));
}

grpc::Status DiagnosisService::Explain(grpc::ServerContext* context, const v1::ExplainRequest* request,
                                       grpc::ServerWriter<v1::ExplainResponse>* writer) {
  const Work work = {
      [request](const diagnosis::DiagnosisInput& input, const diagnosis::DiagnosisContext& how) {
        return AsReport(touchstone::diagnosis::Explain(input, request->effect(), how));
      }};
  v1::Report report;
  return ToGrpc(RunAndSend(context, request->evidence(), work, resources_, writer, &report));
}

grpc::Status DiagnosisService::Uncertainty(grpc::ServerContext* context,
                                           const v1::UncertaintyRequest* request,
                                           grpc::ServerWriter<v1::UncertaintyResponse>* writer) {
  const absl::StatusOr<uncertainty::Posterior> posterior = uncertainty::FromMessage(request->posterior());
  if (!posterior.ok()) return ToGrpc(posterior.status());
  const Work work = {
      [&posterior](const diagnosis::DiagnosisInput& input, const diagnosis::DiagnosisContext& how) {
        return AsReport(touchstone::diagnosis::Uncertainty(input, *posterior, how));
      },
      TimesOfSet::kNotRead};
  v1::Evidence evidence = request->evidence();
  evidence.mutable_model()->set_yaml(request->posterior().model_yaml());
  v1::Report report;
  return ToGrpc(RunAndSend(context, evidence, work, resources_, writer, &report));
}

}  // namespace touchstone::service
