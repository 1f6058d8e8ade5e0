// Names of a bundle's members; who makes one and who replays it agree on them.
#pragma once

namespace touchstone::gateway::bundle {

inline constexpr char kBundleJournal[] = "session.db";
inline constexpr char kBundleAudit[] = "audit.jsonl";
inline constexpr char kBundleConfig[] = "gateway.toml";
inline constexpr char kBundleState[] = "state.json";  // {"rig": RigState, "state": State}
inline constexpr char kBundleModels[] = "models";     // folders
inline constexpr char kBundleMeshes[] = "meshes";

}  // namespace touchstone::gateway::bundle
