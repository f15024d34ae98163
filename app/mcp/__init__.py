"""The MCP server: the service as tools for assistants, through the client."""
