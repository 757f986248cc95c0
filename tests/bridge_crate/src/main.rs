//! A ROS 2 bridge for the tests: the published `ros2dds` plugin, linked in, and nothing else.
//!
//! `test-bridge CONFIG.json5 [path/in/config=json5 ...]` runs until SIGINT or SIGTERM.
//! Each `path=value` overrides one place of the file, so that the shipped configuration is what is
//! tested and only ports and domains differ.

use std::process::ExitCode;

use tokio::signal::unix::{signal, SignalKind};
use zenoh::internal::{plugins::PluginsManager, runtime::RuntimeBuilder};

type Failure = Box<dyn std::error::Error + Send + Sync>;

fn configured(mut args: impl Iterator<Item = String>) -> Result<zenoh::Config, Failure> {
    let path = args.next().ok_or("usage: test-bridge CONFIG.json5 [path=json5 ...]")?;
    let mut config = zenoh::Config::from_file(&path)?;
    // What the stand-alone bridge switches on by itself; the plugin does not work without.
    for (place, value) in [
        ("plugins_loading/enabled", "true"),
        ("timestamping/enabled", "true"),
        ("adminspace/enabled", "true"),
        // The stand-alone bridge is built without it; hiroz, built beside this one, needs it.
        ("transport/shared_memory/enabled", "false"),
    ] {
        config.insert_json5(place, value)?;
    }
    for given in args {
        let (place, value) = given.split_once('=').ok_or("an override is path=json5")?;
        config.insert_json5(place, value)?;
    }
    Ok(config)
}

async fn bridge(config: zenoh::Config) -> Result<(), Failure> {
    let mut plugins = PluginsManager::static_plugins_only();
    plugins.declare_static_plugin::<zenoh_plugin_ros2dds::ROS2Plugin, _>("ros2dds", true);
    for plugin in plugins.declared_plugins_iter_mut() {
        plugin.load()?;
    }
    let runtime = RuntimeBuilder::new(config).plugins_manager(plugins).build().await?;
    let mut runtime = runtime;
    runtime.start().await?;
    eprintln!("test-bridge: running");
    let mut terminate = signal(SignalKind::terminate())?;
    let mut interrupt = signal(SignalKind::interrupt())?;
    tokio::select! { _ = terminate.recv() => {}, _ = interrupt.recv() => {} }
    Ok(())
}

fn main() -> ExitCode {
    zenoh::init_log_from_env_or("error");
    let run = configured(std::env::args().skip(1)).and_then(|config| {
        tokio::runtime::Builder::new_multi_thread().enable_all().build()?.block_on(bridge(config))
    });
    if let Err(failure) = run {
        eprintln!("test-bridge: {failure}");
        return ExitCode::FAILURE;
    }
    // The plugin's own threads have no orderly end: leave without waiting for them.
    std::process::exit(0)
}
