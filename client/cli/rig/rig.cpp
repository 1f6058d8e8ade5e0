// touchstone rig: the group, and what its commands share.
#include "client/cli/rig/rig.h"

#include <google/protobuf/util/json_util.h>

#include "server/base/status.h"

namespace touchstone::cli {
absl::StatusOr<RigConnection> ConnectToRig(const Cli& cli) {
  if (cli.source().servers.empty())
    return absl::InvalidArgumentError(
        "--server is missing: a rig is reached through its touchstone-gateway, for instance --server "
        "127.0.0.1:50052");
  RigConnection rig;
  TOUCHSTONE_ASSIGN_OR_RETURN(rig.connection, cli.Connect());
  TOUCHSTONE_ASSIGN_OR_RETURN(rig.source,
                              rig.connection->Call(&v1::Source::Stub::Describe, v1::DescribeRequest()));
  if (rig.source.kind() != v1::SOURCE_KIND_PHYSICAL)
    return absl::FailedPreconditionError(
        absl::StrCat(rig.connection->address(), " is a ", client::SourceKindName(rig.source.kind()),
                     " source, which has no rig; touchstone touch --plan makes a plan's touches there"));
  return rig;
}

absl::StatusOr<v1::RigState> GetRig(client::Connection* connection) {
  return connection->Call(&v1::Rig::Stub::GetRig, v1::GetRigRequest());
}

absl::StatusOr<Json> RigJson(const v1::State& state, const v1::RigState& rig) {
  google::protobuf::util::JsonPrintOptions print;
  print.always_print_primitive_fields = true;
  print.preserve_proto_field_names = true;
  Json json;
  for (const auto& [name, message] :
       {std::pair<const char*, const google::protobuf::Message*>{"state", &state}, {"rig", &rig}}) {
    std::string text;
    if (!google::protobuf::util::MessageToJsonString(*message, &text, print).ok())
      return absl::InternalError("the rig's state cannot be written as JSON");
    json[name] = Json::parse(text);
  }
  return json;
}

absl::Status MountForTouches(const Cli& cli, client::LeasedSource* source, const v1::RigState& state,
                             const std::string& object, const std::string& up_face) {
  if (state.mounts_itself() && (state.object() != object || client::UpFaceWord(state.up_face()) != up_face))
    cli.Log(absl::StrCat("the rig puts ", object, " on the fixture with its face ", up_face, " up"));
  return source->EnsureMounted(state, object, client::UpFaceOf(up_face), [&] {
    return AskPerson(client::RestingFaceRequest(object, up_face, state.object()));
  });
}

std::string ImpossibleTable(const std::vector<PlannedRow>& rows, size_t max_lines) {
  Table table({"TOUCH", "OBJECT", "FACE UP", "WHY NOT"});
  size_t lines = 0, more = 0;
  for (const PlannedRow& row : rows) {
    if (row.possible) continue;
    if (lines == max_lines) {
      ++more;
      continue;
    }
    ++lines;
    table.Add({std::to_string(row.touch.touch), row.touch.object, row.up_face, row.reason});
  }
  if (lines == 0) return "";
  return table.Text() + (more > 0 ? absl::StrCat("and ", more, " more\n") : "");
}

void AddRig(Cli* cli) {
  CLI::App* group = cli->AddGroup(
      "rig",
      "Works a rig through its touchstone-gateway: state, motions, calibration, whole sessions of touches.",
      "touchstone rig status --server 127.0.0.1:50052\n"
      "touchstone rig stop --server 127.0.0.1:50052\n"
      "touchstone rig reset --reason 'cable freed' --server 127.0.0.1:50052\n"
      "touchstone rig dry-run plan.csv -o path.svg --server 127.0.0.1:50052\n"
      "touchstone rig run plan.csv -o session.db --server 127.0.0.1:50052");
  AddRigStatus(cli, group);
  AddRigMotions(cli, group);
  AddRigDryRun(cli, group);
  AddRigRun(cli, group);
  AddRigPhotos(cli, group);
  AddRigCalibrate(cli, group);
  AddRigTeach(cli, group);
  AddRigBundle(cli, group);
}

}  // namespace touchstone::cli
