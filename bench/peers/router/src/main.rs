//! A Zenoh node with the published `remote_api` plugin linked in, and nothing else.
//!
//! `bench-router CONFIG.json5` runs until SIGINT or SIGTERM.

use std::process::ExitCode;

use tokio::signal::unix::{signal, SignalKind};
use zenoh::internal::{plugins::PluginsManager, runtime::RuntimeBuilder};

type Failure = Box<dyn std::error::Error + Send + Sync>;

async fn route(config: zenoh::Config) -> Result<(), Failure> {
    let mut plugins = PluginsManager::static_plugins_only();
    plugins
        .declare_static_plugin::<zenoh_plugin_remote_api::RemoteApiPlugin, _>("remote_api", true);
    for plugin in plugins.declared_plugins_iter_mut() {
        plugin.load()?;
    }
    let mut runtime = RuntimeBuilder::new(config).plugins_manager(plugins).build().await?;
    runtime.start().await?;
    let mut terminate = signal(SignalKind::terminate())?;
    let mut interrupt = signal(SignalKind::interrupt())?;
    tokio::select! { _ = terminate.recv() => {}, _ = interrupt.recv() => {} }
    Ok(())
}

fn main() -> ExitCode {
    zenoh::init_log_from_env_or("error");
    let done = std::env::args()
        .nth(1)
        .ok_or_else(|| "usage: bench-router CONFIG.json5".into())
        .and_then(zenoh::Config::from_file)
        .and_then(|config| {
            tokio::runtime::Builder::new_multi_thread().enable_all().build()?.block_on(route(config))
        });
    if let Err(failure) = done {
        eprintln!("bench-router: {failure}");
        return ExitCode::FAILURE;
    }
    // The plugin's own threads have no orderly end: leave without waiting for them.
    std::process::exit(0)
}
